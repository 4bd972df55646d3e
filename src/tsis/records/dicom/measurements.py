"""An estimate and the presses as measurement groups of TID 1501."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tsis.__about__ import __version__
from tsis.model.estimate import INTERVAL_LEVEL
from tsis.records.dicom import codes
from tsis.records.dicom.cover import dicom_line
from tsis.records.dicom.files import deterministic_uid
from tsis.records.dicom.libraries import highdicom
from tsis.records.values import ROLE_WORDS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pydicom.dataset import Dataset

    from tsis.model import Estimate
    from tsis.records import StoredEstimate, StoredPress
    from tsis.records.dicom.cover import ExportIdentity

NOT_TRUSTED = "A flag says that the model does not hold, so this estimate has no numbers that may be used."


def estimate_group(stored: StoredEstimate, cover: ExportIdentity, sources: Sequence[Dataset]) -> Any:
    """What was estimated, with its doubts; no numbers where the model does not hold.

    A parameter that the data do not identify has no mean and no standard deviation either: its percentiles say in
    which range it may lie.
    """
    sr, estimate = highdicom("sr"), stored.estimate
    trusted = codes.concept(codes.YES if estimate.trusted else codes.NO)
    group = sr.MeasurementsAndQualitativeEvaluations(
        tracking_identifier=_tracking(f"estimate of {stored.kind}", cover, stored.id),
        method=codes.own("imaging"),
        algorithm_id=_algorithm(stored),
        measurements=_numbers(estimate) if estimate.trusted else [],
        qualitative_evaluations=[sr.QualitativeEvaluation(name=codes.own("trusted"), value=trusted)],
        source_images=[sr.SourceImageForMeasurementGroup(each.SOPClassUID, each.SOPInstanceUID) for each in sources],
    )
    for name, sentence in _sentences(estimate):
        group[0].ContentSequence.append(text(name, sentence))
    return group


def _numbers(estimate: Estimate) -> list[Any]:
    found = []
    for name in estimate.samples:
        if name in codes.PARAMETERS:
            low, high = estimate.interval(INTERVAL_LEVEL)[name]
            known = estimate.identified(name)
            values = [(codes.MEAN, estimate.mean[name]), (codes.STANDARD_DEVIATION, estimate.sd[name])] if known else []
            values += [(codes.FIFTH_PERCENTILE, low), (codes.NINETY_FIFTH_PERCENTILE, high)]
            found += [_number(codes.PARAMETERS[name], value, derivation) for derivation, value in values]
    if estimate.presence is not None:
        found.append(_number((codes.PROBABILITY, codes.ONE, "presence"), estimate.presence, None))
    return found


def _number(kind: tuple[Any, Any, str | None], value: float, derivation: tuple[str, str, str] | None) -> Any:
    name, unit, method = kind
    return highdicom("sr").Measurement(
        name=codes.concept(name),
        value=float(f"{value:.6g}"),
        unit=codes.concept(unit),
        method=codes.own(method) if method else None,
        derivation=codes.concept(derivation) if derivation else None,
    )


def _sentences(estimate: Estimate) -> list[tuple[str, str]]:
    """Texts by our code; the sentence on what is identified holds numbers, so an untrusted one is not told."""
    told = {name for name in codes.PARAMETERS if estimate.trusted and estimate.identified(name)}
    loose = [name for name in estimate.samples if name not in told]
    said = [("no-number", name) for name in loose]
    said += [("flag", flag) for flag in estimate.flags]
    if estimate.trusted:
        said.append(("identifiability", estimate.identifiability))
    else:
        said.append(("identifiability", NOT_TRUSTED))
    said.append(("prior", estimate.prior))
    return [(name, sentence) for name, sentence in said if sentence.strip()]


def press_group(press: StoredPress, cover: ExportIdentity, source: Dataset, frame: int) -> Any:
    """The force of one press and what its guard said, with the frame that it belongs to."""
    sr = highdicom("sr")
    frames = [frame] if "NumberOfFrames" in source else None
    group = sr.MeasurementsAndQualitativeEvaluations(
        tracking_identifier=_tracking(f"press {ROLE_WORDS[press.role]}", cover, press.id or press.frame),
        method=codes.own("imaging"),
        measurements=[
            sr.Measurement(
                name=codes.concept(codes.FORCE), value=float(press.force_n), unit=codes.concept(codes.NEWTON)
            )
        ]
        if press.force_n is not None
        else [],
        source_images=[sr.SourceImageForMeasurementGroup(source.SOPClassUID, source.SOPInstanceUID, frames)],
    )
    for name, word in [("role", press.role), *(("flag", flag) for flag in press.flags)]:
        group[0].ContentSequence.append(text(name, word))
    return group


def text(name: str, sentence: str) -> Any:
    """A sentence under one of our codes."""
    sr = highdicom("sr")
    return sr.TextContentItem(
        name=codes.own(name), value=sentence, relationship_type=sr.RelationshipTypeValues.CONTAINS
    )


def _tracking(what: str, cover: ExportIdentity, identity: str) -> Any:
    return highdicom("sr").TrackingIdentifier(uid=deterministic_uid("tracking", cover.key, identity), identifier=what)


def _algorithm(stored: StoredEstimate) -> Any:
    """Which program computed it, and which code of it, as the record says; not the program that exports."""
    environment: Mapping[str, Any] = stored.environment
    code = environment.get("code_sha256")
    return highdicom("sr").AlgorithmIdentification(
        name=f"tsis {stored.kind}",
        version=dicom_line(str(environment.get("tsis") or stored.estimate.provenance.get("tsis") or __version__)),
        parameters=[f"code_sha256={dicom_line(str(code))}"] if code else None,
    )
