"""Export of a target: its frames, and the structured report with measurement groups of TID 1501."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.errors import RecordsError
from tsis.model import INTERVAL_LEVEL
from tsis.records._values import ROLE_NAMES
from tsis.records.dicom import _modules as codes
from tsis.records.dicom._capture import capture, stacks
from tsis.records.dicom._files import DicomFile, deterministic_uid, highdicom, sealed, write_files
from tsis.records.dicom._identity import dicom_line, export_identity
from tsis.records.dicom._modules import Series, describe

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from pydicom.dataset import Dataset

    from tsis.model import Estimate
    from tsis.records._target_record import TargetRecord
    from tsis.records._values import StoredEstimate, StoredPress
    from tsis.records.dicom._capture import Stack
    from tsis.records.dicom._identity import ExportIdentity


def estimate_group(stored: StoredEstimate, cover: ExportIdentity, sources: Sequence[Dataset]) -> Any:
    """An estimate, without numbers where it is untrusted.

    A parameter that is not identified has percentiles, but no mean and no standard deviation.
    """
    sr, estimate = highdicom("sr"), stored.estimate
    trusted = codes.concept(codes.YES if estimate.trusted else codes.NO)
    group = sr.MeasurementsAndQualitativeEvaluations(
        tracking_identifier=_tracking(f"estimate of {stored.kind}", cover, stored.id),
        method=codes.own("imaging"),
        algorithm_id=_algorithm(stored),
        measurements=_numbers(estimate),
        qualitative_evaluations=[sr.QualitativeEvaluation(name=codes.own("trusted"), value=trusted)],
        source_images=[
            sr.SourceImageForMeasurementGroup(source.SOPClassUID, source.SOPInstanceUID) for source in sources
        ],
    )
    for name, message in _statements(estimate):
        group[0].ContentSequence.append(text(name, message))
    return group


def _numbers(estimate: Estimate) -> list[Any]:
    results = []
    for name in estimate.names if estimate.trusted else ():
        if name in codes.PARAMETERS:
            low, high = estimate.interval(INTERVAL_LEVEL)[name]
            moments = ((codes.MEAN, estimate.mean), (codes.STANDARD_DEVIATION, estimate.sd))
            values = [(code, values[name]) for code, values in moments if name in values]
            values += [(codes.FIFTH_PERCENTILE, low), (codes.NINETY_FIFTH_PERCENTILE, high)]
            results += [_number(codes.PARAMETERS[name], value, derivation) for derivation, value in values]
    if estimate.printed_presence is not None:
        results.append(_number((codes.PROBABILITY, codes.UNITLESS, "presence"), estimate.printed_presence, None))
    return results


def _number(kind: tuple[Any, Any, str | None], value: float, derivation: tuple[str, str, str] | None) -> Any:
    name, unit, method = kind
    return highdicom("sr").Measurement(
        name=codes.concept(name),
        value=float(f"{value:.6g}"),
        unit=codes.concept(unit),
        method=codes.own(method) if method else None,
        derivation=codes.concept(derivation) if derivation else None,
    )


def _statements(estimate: Estimate) -> list[tuple[str, str]]:
    """Texts by our codes; the message on identifiability contains numbers, so an untrusted estimate has another."""
    numbered = {name for name in estimate.names if name in codes.PARAMETERS and not estimate.withheld_reason(name)}
    messages = [("no-number", name) for name in estimate.names if name not in numbered]
    messages += [("flag", flag) for flag in estimate.flags]
    messages.append(("identifiability", estimate.printed_identifiability))
    messages.append(("prior", estimate.prior))
    return [(name, message) for name, message in messages if message.strip()]


def press_group(press: StoredPress, cover: ExportIdentity, source: Dataset, frame: int) -> Any:
    """Force, role and flags of a press with its frame."""
    sr = highdicom("sr")
    frames = [frame] if "NumberOfFrames" in source else None
    group = sr.MeasurementsAndQualitativeEvaluations(
        tracking_identifier=_tracking(f"press {ROLE_NAMES[press.role]}", cover, press.id or press.frame),
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
    for name, term in [("role", press.role), *(("flag", flag) for flag in press.flags)]:
        group[0].ContentSequence.append(text(name, term))
    return group


def text(name: str, message: str) -> Any:
    """A text item under our code ``name``."""
    sr = highdicom("sr")
    return sr.TextContentItem(name=codes.own(name), value=message, relationship_type=sr.RelationshipTypeValues.CONTAINS)


def _tracking(what: str, cover: ExportIdentity, identity: str) -> Any:
    return highdicom("sr").TrackingIdentifier(uid=deterministic_uid("tracking", cover.key, identity), identifier=what)


def _algorithm(stored: StoredEstimate) -> Any:
    """The program and code that computed the estimate, which may differ from the exporting program."""
    environment: Mapping[str, Any] = stored.environment
    code = environment.get("code_sha256")
    return highdicom("sr").AlgorithmIdentification(
        name=f"tsis {stored.kind}",
        version=dicom_line(str(environment.get("tsis") or stored.estimate.provenance.get("tsis") or __version__)),
        parameters=[f"code_sha256={dicom_line(str(code))}"] if code else None,
    )


SERIES = 9
NO_DATE, NO_TIME = "19000101", "000000"  # a report must have a time; this one marks a removed one

# Attributes with the present time, which would make equal exports differ.
OF_NOW = ("InstanceCreationDate", "InstanceCreationTime", "ContributingEquipmentSequence")


def has_report(record: TargetRecord) -> bool:
    """Whether there is an estimate, a force, or a flag to report."""
    return bool(record.estimates) or any(press.force_n is not None or press.flags for press in record.presses)


def report(record: TargetRecord, cover: ExportIdentity, images: Sequence[tuple[Stack, Dataset]]) -> Dataset:
    """The report on the exported images, still without a UID."""
    created = max([stored.made for stored in record.active_estimates] or [press.taken for press in record.presses])
    date, time = cover.moment(created) or (NO_DATE, NO_TIME)
    sr = highdicom("sr")
    document: Dataset = sr.ComprehensiveSR(
        evidence=[image for _, image in images],
        content=_content(record, cover, images)[0],
        series_instance_uid=deterministic_uid("series", cover.key, "report"),
        series_number=SERIES,
        sop_instance_uid=deterministic_uid("unsealed"),
        instance_number=1,
        manufacturer="tsis",
        is_complete=True,
        content_date=date,
        content_time=time,
        coding_schemes=[
            highdicom("coding_schemes").CodingSchemeIdentificationItem(codes.SCHEME, name=codes.SCHEME_NAME)
        ],
    )
    described = "Estimate and forces, research use only"
    describe(
        document, cover, Series(number=SERIES, what="report", description=described, modality="SR", started=created)
    )
    for what in OF_NOW:
        del document[what]
    document.ContentDate, document.ContentTime = date, time
    return document


def _content(record: TargetRecord, cover: ExportIdentity, images: Sequence[tuple[Stack, Dataset]]) -> Any:
    sr = highdicom("sr")
    positions = {  # by object: two presses may have the same frame, and presses outside a store have no identity
        id(press): (image, number) for stack, image in images for number, press in enumerate(stack.presses, 1)
    }
    groups = [
        estimate_group(stored, cover, [image for stack, image in images if stack.contains(stored.presses)])
        for stored in record.active_estimates
    ]
    groups += [
        press_group(press, cover, *positions[id(press)])
        for press in record.presses
        if press.force_n is not None or press.flags
    ]
    content = sr.MeasurementReport(
        observation_context=_observer(),
        procedure_reported=codes.own("imaging"),
        imaging_measurements=groups,
    )
    notice = text("notice", RESEARCH_USE_ONLY)
    content[0].ContentSequence.insert(-1, notice)  # before any number
    return content


def _observer() -> Any:
    sr = highdicom("sr")
    device = sr.DeviceObserverIdentifyingAttributes(
        uid=deterministic_uid("device", __version__), name="tsis", manufacturer_name="tsis", model_name=__version__
    )
    context = sr.ObserverContext(observer_type=codes.concept(codes.DEVICE), observer_identifying_attributes=device)
    return sr.ObservationContext(observer_device_context=context)


def dicom_files(record: TargetRecord, *, identified: bool = False) -> tuple[DicomFile, ...]:
    """The instances of a target: Secondary Captures by role and probe of its presses, then a report.

    Equal records give equal bytes and UIDs with the same version. There is a report when there is an estimate, a force,
    or a flag of a press.

    Parameters
    ----------
    record
        The target with its presses and estimates.
    identified
        Whether to include the label of the target, the names of frames and the times. Otherwise the record is
        de-identified (`tsis.records._deidentify`). Notes and camera settings are never exported.

    Raises
    ------
    RecordsError
        When there is no press, or a frame does not match its press.
    MissingExtraError
        When the libraries of the extra ``dicom`` are not installed.
    """
    if not record.presses:
        raise RecordsError(f"target {record.target.number} must have at least one press to be exported; got none")
    exported, cover = export_identity(record, identified=identified)
    images, files = [], []
    for stack in stacks(exported):
        image = capture(stack, cover)
        files.append(sealed(image, f"{cover.file_stem}-{stack.series}-{stack.role}-{stack.number:02d}.dcm"))
        images.append((stack, image))
    if has_report(exported):
        files.append(sealed(report(exported, cover, images), f"{cover.file_stem}-9-report-01.dcm"))
    return tuple(files)


def write_dicom(record: TargetRecord, folder: Path, *, identified: bool = False) -> tuple[Path, ...]:
    """Write the instances of `dicom_files` into a folder and return the paths; errors as these two functions."""
    return write_files(dicom_files(record, identified=identified), folder)
