"""DICOM files of a target: its frames as Secondary Capture, its forces and estimates as a structured report.

`dicom_files` gives the instances in memory, `write_dicom` writes them into a folder.
"""

from __future__ import annotations

import hashlib
import itertools
import math
import re
import uuid
from dataclasses import dataclass
from datetime import UTC
from io import BytesIO
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.errors import RecordsError, import_extra
from tsis.files.atomic import add_files
from tsis.model.estimate import INTERVAL_LEVEL
from tsis.records.deidentification import deidentified, from_camera, public_identity
from tsis.records.values import ROLE_NAMES, ROLES

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
    from datetime import datetime

    from numpy.typing import NDArray
    from pydicom.dataset import Dataset

    from tsis.model.estimate import Estimate
    from tsis.records.values import StoredEstimate, StoredPress, Target, TargetRecord


def _pydicom(part: str = "") -> Any:
    """Pydicom or a module of it."""
    return import_extra(f"pydicom.{part}" if part else "pydicom", feature="DICOM", extra="dicom")


def _highdicom(part: str = "") -> Any:
    """Highdicom or a module of it."""
    return import_extra(f"highdicom.{part}" if part else "highdicom", feature="a DICOM report", extra="dicom")


_IMPLEMENTATION = "2.25." + str(uuid.uuid5(uuid.NAMESPACE_DNS, "tsis.implementation").int)


@dataclass(frozen=True, slots=True, kw_only=True)
class DicomFile:
    """An instance as a file, explicit VR little endian."""

    name: str
    content: bytes
    sop_class_uid: str
    sop_instance_uid: str

    def dataset(self) -> Dataset:
        """The instance as pydicom reads it."""
        dataset: Dataset = _pydicom().dcmread(BytesIO(self.content))
        return dataset


def deterministic_uid(*parts: str | bytes) -> str:
    """A UID below 2.25 (PS3.5 B.2) from a UUID of version 5 of the parts."""
    digest = hashlib.sha256(b"tsis dicom")
    for part in parts:
        raw = part.encode() if isinstance(part, str) else part
        digest.update(len(raw).to_bytes(8, "big") + raw)
    return f"2.25.{uuid.UUID(bytes=digest.digest()[:16], version=5).int}"


def sealed(dataset: Dataset, name: str) -> DicomFile:
    """Set the UID of an instance from its content, and write it.

    Equal content gives equal bytes and UIDs, and a UID never identifies two contents.
    """
    dataset.SOPInstanceUID = deterministic_uid("unsealed")
    dataset.SOPInstanceUID = deterministic_uid("instance", _bytes(dataset))
    return DicomFile(
        name=name,
        content=_bytes(dataset),
        sop_class_uid=str(dataset.SOPClassUID),
        sop_instance_uid=str(dataset.SOPInstanceUID),
    )


def _bytes(dataset: Dataset) -> bytes:
    meta = _pydicom("dataset").FileMetaDataset()
    meta.MediaStorageSOPClassUID = dataset.SOPClassUID
    meta.MediaStorageSOPInstanceUID = dataset.SOPInstanceUID
    meta.TransferSyntaxUID = _pydicom("uid").ExplicitVRLittleEndian
    meta.ImplementationClassUID = _IMPLEMENTATION
    meta.ImplementationVersionName = "TSIS"
    dataset.file_meta = meta
    with BytesIO() as file:
        _pydicom().dcmwrite(file, dataset, enforce_file_format=True)
        return file.getvalue()


_LONGEST = 64  # of the value representations LO and PN


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportIdentity:
    """The target of an export, de-identified unless ``identified``."""

    identified: bool
    target: Target

    @property
    def key(self) -> str:
        """The source of UIDs, independent for identified and de-identified exports."""
        return f"{'identified' if self.identified else 'de-identified'} {self.target.id}"

    @property
    def patient_name(self) -> str:
        """Label of the target as a DICOM name, without its special characters."""
        label = _dicom_line(re.sub(r"[\^=]", " ", self.target.name), _LONGEST - 1) or f"target {self.target.number}"
        return f"{label if self.identified else self.target.id}^"  # the caret marks an intentional single component

    @property
    def patient_id(self) -> str:
        """Kind and number of the target, or the pseudonym; never its identity."""
        return public_identity(self.target) if self.identified else self.target.id

    @property
    def file_stem(self) -> str:
        """Start of the file names."""
        return f"tsis-{self.target.number:05d}" if self.identified else self.target.id.lower()

    def moment(self, when: datetime) -> tuple[str, str] | None:
        """Date and time in UTC as DICOM text; None for a de-identified export."""
        if not self.identified:
            return None
        when = when.astimezone(UTC)
        return f"{when.year:04d}" + when.strftime("%m%d"), when.strftime("%H%M%S.%f")


def _export_identity(record: TargetRecord, *, identified: bool) -> tuple[TargetRecord, ExportIdentity]:
    """The record to export and its identity; `RecordsError` when the target has no id."""
    if not record.target.id:
        raise RecordsError("the target must have an identity, which a store gives it; got a target without id")
    exported = record if identified else deidentified(record)
    return exported, ExportIdentity(identified=identified, target=exported.target)


def _dicom_line(text: str, longest: int = _LONGEST) -> str:
    """Text as a short DICOM value: one line without backslashes, of limited length in bytes."""
    line = " ".join("".join(letter if letter.isprintable() else " " for letter in text.replace("\\", "/")).split())
    return line.encode()[:longest].decode(errors="ignore").strip()


SCHEME = "99TSIS"
_SCHEME_NAME = "Codes of tsis, open software for optical tactile imaging"

# Our codes: value -> meaning.
_OWN = MappingProxyType(
    {
        "imaging": "Optical tactile imaging",
        "young": "Young's modulus",
        "presence": "Presence of an inclusion",
        "trusted": "Model holds, numbers may be used",
        "flag": "Quality flag",
        "identifiability": "What the data tell and what not",
        "prior": "Belief before the data",
        "role": "Role of the press",
        "notice": "Notice",
        "no-number": "Parameter without a number",
    }
)
_MILLIMETRE, KILOPASCAL, _NEWTON, _UNITLESS = (
    ("mm", "UCUM", "millimeter"),
    ("kPa", "UCUM", "kilopascal"),
    ("N", "UCUM", "newton"),
    ("1", "UCUM", "no units"),
)
_DIAMETER = ("81827009", "SCT", "Diameter")
_DEPTH = ("131197000", "SCT", "Depth")
ELASTICITY = ("110830", "DCM", "Elasticity")
_FORCE = ("111647", "DCM", "Compression Force")
_PROBABILITY = ("122157", "DCM", "Probability")
_MEAN = ("373098007", "SCT", "Mean")
_STANDARD_DEVIATION = ("386136009", "SCT", "Standard Deviation")
_FIFTH_PERCENTILE = ("371888009", "SCT", "Fifth percentile")
_NINETY_FIFTH_PERCENTILE = ("371889001", "SCT", "Ninety-fifth percentile")
_DEVICE = ("121007", "DCM", "Device")
_YES, _NO = ("373066001", "SCT", "Yes"), ("373067005", "SCT", "No")

# Parameter of an estimate -> concept, unit, and the method where the concept is not precise.
_PARAMETERS = MappingProxyType(
    {
        "diameter_mm": (_DIAMETER, _MILLIMETRE, None),
        "depth_mm": (_DEPTH, _MILLIMETRE, None),
        "young_kpa": (ELASTICITY, KILOPASCAL, "young"),
    }
)


def concept(triple: tuple[str, str, str]) -> Any:
    """A code of value, scheme and meaning for highdicom."""
    value, scheme, meaning = triple
    return _highdicom("sr").CodedConcept(value=value, scheme_designator=scheme, meaning=meaning)


def _own(value: str) -> Any:
    """One of our own codes."""
    return concept((value, SCHEME, _OWN[value]))


def coding_schemes() -> list[Any]:
    """The identification of our own codes, which an instance with such codes contains."""
    return [_highdicom("coding_schemes").CodingSchemeIdentificationItem(SCHEME, name=_SCHEME_NAME)]


# PS3.16 CID 7050: the profile and its options.
_METHODS = (
    ("113100", "Basic Application Confidentiality Profile"),
    ("113104", "Clean Structured Content Option"),
    ("113105", "Clean Descriptors Option"),
)
_METHOD_TEXT = ("Pseudonym for name and ID", "Dates and times removed", "New UIDs", "No free text, names or settings")


@dataclass(frozen=True, slots=True, kw_only=True)
class Series:
    """The common attributes of a series."""

    number: int  # in the study, from 1
    what: str  # source of its UID, e.g. role and probe of the presses
    description: str
    modality: str  # "OT" for images, "SR" for reports
    started: datetime  # time of its first instance


def _code(value: str, scheme: str, meaning: str) -> Dataset:
    """An item of a code sequence."""
    item: Dataset = _pydicom().Dataset()
    item.CodeValue, item.CodingSchemeDesignator, item.CodeMeaning = value, scheme, meaning
    return item


def describe(dataset: Dataset, cover: ExportIdentity, series: Series) -> None:
    """Write patient, study, series, equipment and the common attributes into a dataset."""
    dataset.SpecificCharacterSet = "ISO_IR 192"  # UTF-8
    _describe_patient(dataset, cover)
    dataset.StudyInstanceUID = deterministic_uid("study", cover.key)
    dataset.StudyDate, dataset.StudyTime = cover.moment(cover.target.made) or ("", "")
    dataset.StudyID = str(cover.target.number) if cover.identified else cover.target.id[5:]
    dataset.StudyDescription = "Optical tactile imaging, research use only"
    dataset.AccessionNumber = dataset.ReferringPhysicianName = ""
    dataset.SeriesInstanceUID = deterministic_uid("series", cover.key, series.what)
    dataset.SeriesNumber = series.number
    dataset.SeriesDescription = _dicom_line(series.description)
    dataset.Modality = series.modality
    dataset.Manufacturer = dataset.ManufacturerModelName = "tsis"
    dataset.SoftwareVersions = __version__
    if moment := cover.moment(series.started):
        dataset.SeriesDate, dataset.SeriesTime = moment
        dataset.TimezoneOffsetFromUTC = "+0000"


def _describe_patient(dataset: Dataset, cover: ExportIdentity) -> None:
    dataset.PatientName, dataset.PatientID = cover.patient_name, cover.patient_id
    dataset.PatientBirthDate = dataset.PatientSex = ""
    dataset.QualityControlSubject = "YES" if cover.target.kind == "phantom" else "NO"
    if cover.identified:
        dataset.PatientIdentityRemoved = "NO"
        dataset.PatientComments = f"Label: {cover.target.name}\r\n{RESEARCH_USE_ONLY}"
    else:
        dataset.PatientIdentityRemoved = "YES"
        dataset.DeidentificationMethod = list(_METHOD_TEXT)
        dataset.DeidentificationMethodCodeSequence = [_code(value, "DCM", meaning) for value, meaning in _METHODS]
        dataset.LongitudinalTemporalInformationModified = "REMOVED"


_MOST_BYTES = 2**28  # of pixels in an instance, accepted by archives and far below DICOM's limit of 4 GiB
_OTHER_PROBE = 10  # between the numbers of series of one role and different probes: 1, 11, 21, ...


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Stack:
    """Presses of one role, probe, size, depth and scale, in the order of their times."""

    role: str
    probe: str  # empty where unknown
    series: int  # number of the series of this role and probe
    started: datetime  # time of the first press of the series
    number: int  # of the instance in its series, from 1
    presses: tuple[StoredPress, ...]  # one for each frame
    levels: NDArray[Any]  # shape (frames, rows, columns), uint8 or uint16

    def contains(self, presses: Collection[str]) -> bool:
        """Whether it has a frame of these presses, by identity."""
        return any(press.id in presses for press in self.presses)


def _stacks(record: TargetRecord) -> Iterator[_Stack]:
    """Stacks of equal frames by role and probe; `RecordsError` when a frame does not match its press."""
    for index, role in enumerate(ROLES, start=1):
        pressed = sorted((press for press in record.presses if press.role == role), key=lambda item: item.taken)
        for other, probe in enumerate(dict.fromkeys(press.probe for press in pressed)):
            presses = [press for press in pressed if press.probe == probe]
            yield from _series(record, presses, index + other * _OTHER_PROBE)


def _series(record: TargetRecord, presses: list[StoredPress], number: int) -> Iterator[_Stack]:
    kinds: dict[tuple[Any, ...], list[tuple[StoredPress, NDArray[Any]]]] = {}
    for press in presses:
        levels = record.levels(press)
        kinds.setdefault((levels.shape, levels.dtype, press.mm_per_pixel, press.full_scale), []).append((press, levels))
    instances = itertools.count(1)
    for frames in kinds.values():
        most = max(1, _MOST_BYTES // frames[0][1].nbytes)
        for first in range(0, len(frames), most):
            some = frames[first : first + most]
            yield _Stack(
                role=presses[0].role,
                probe=presses[0].probe,
                series=number,
                started=presses[0].taken,
                number=next(instances),
                presses=tuple(press for press, _ in some),
                levels=np.stack([levels for _, levels in some]),
            )


def _increments_ms(presses: tuple[StoredPress, ...]) -> list[str]:
    """Intervals between frames in milliseconds as decimal strings, the first 0."""
    times = [press.taken for press in presses]
    gaps = [0.0, *((late - early).total_seconds() * 1e3 for early, late in itertools.pairwise(times))]
    return [_decimal(gap) for gap in gaps]


def _decimal(value: float) -> str:
    """A number as a DICOM decimal string, at most 16 characters, with as many digits as fit."""
    if not math.isfinite(value):
        raise RecordsError(f"a number of a DICOM file must be finite; got {value}")
    for digits in range(17, 0, -1):
        text = f"{value:.{digits}g}"
        if len(text) <= 16:
            return text
    raise AssertionError(value)  # one digit with sign and exponent has at most 7 characters


_FRAME_TIME_VECTOR = 0x00181065
_LONGEST_TEXT = 10_000  # of the value representation LT


def _capture(stack: _Stack, cover: ExportIdentity) -> Dataset:
    """A Secondary Capture instance of a stack, still without a UID.

    One frame becomes a Secondary Capture Image, more a Multi-frame Grayscale Byte (8 bit) or Word (16 bit) one.
    """
    dataset: Dataset = _pydicom().Dataset()
    dataset.SOPClassUID = _sop_class(stack)
    probe = _dicom_line(stack.probe)
    series = Series(
        number=stack.series,
        what=f"{stack.role}, {stack.probe}",
        description=f"{'Frames' if stack.role == 'untouched' else 'Presses'} {ROLE_NAMES[stack.role]}"
        + (f", probe {probe}" if probe else ""),
        modality="OT",
        started=stack.started,
    )
    describe(dataset, cover, series)
    _image(dataset, stack, cover)
    _pixels(dataset, stack)
    _display(dataset, stack)
    if len(stack.presses) > 1:
        _frames(dataset, stack)
    return dataset


def _sop_class(stack: _Stack) -> Any:
    uid = _pydicom("uid")
    if len(stack.presses) == 1:
        return uid.SecondaryCaptureImageStorage
    if stack.levels.dtype == np.uint8:
        return uid.MultiFrameGrayscaleByteSecondaryCaptureImageStorage
    return uid.MultiFrameGrayscaleWordSecondaryCaptureImageStorage


def _image(dataset: Dataset, stack: _Stack, cover: ExportIdentity) -> None:
    dataset.InstanceNumber = stack.number
    dataset.ImageType = ["ORIGINAL", "SECONDARY"]
    dataset.ConversionType = "DI"
    dataset.Laterality = ""  # required for a part that may be paired; unknown
    dataset.PatientOrientation = ""
    dataset.LossyImageCompression = "00"
    dataset.ImageComments = RESEARCH_USE_ONLY
    dataset.ContentDate, dataset.ContentTime = cover.moment(stack.presses[0].taken) or ("", "")
    if moment := cover.moment(stack.presses[0].taken):
        dataset.AcquisitionDate, dataset.AcquisitionTime = moment
        dataset.AcquisitionDateTime = "".join(moment)
        names = ", ".join(_dicom_line(press.name) or "unnamed" for press in stack.presses)
        dataset.ImageComments = _dicom_line(f"{RESEARCH_USE_ONLY} Frames: {names}", _LONGEST_TEXT)


def _pixels(dataset: Dataset, stack: _Stack) -> None:
    _, rows, columns = stack.levels.shape
    byte = stack.levels.dtype == np.uint8
    highest = max(int(stack.levels.max()), int(stack.presses[0].full_scale))
    dataset.SamplesPerPixel, dataset.PhotometricInterpretation = 1, "MONOCHROME2"
    dataset.Rows, dataset.Columns = rows, columns
    dataset.BitsAllocated = 8 if byte else 16
    dataset.BitsStored = 8 if byte else min(16, max(9, highest.bit_length()))
    dataset.HighBit = dataset.BitsStored - 1
    dataset.PixelRepresentation = 0
    raw = stack.levels.astype("u1" if byte else "<u2").tobytes()
    dataset.add_new("PixelData", "OB" if byte else "OW", raw + b"\0" * (len(raw) % 2))
    if scale := stack.presses[0].mm_per_pixel:
        x, y = scale
        dataset.PixelSpacing = [_decimal(y), _decimal(x)]  # distance of rows first


def _display(dataset: Dataset, stack: _Stack) -> None:
    """Set the display window from black to full scale."""
    full = stack.presses[0].full_scale
    dataset.WindowCenter, dataset.WindowWidth = _decimal((full + 1) / 2), _decimal(full + 1)
    dataset.PresentationLUTShape = "IDENTITY"


def _frames(dataset: Dataset, stack: _Stack) -> None:
    dataset.NumberOfFrames = len(stack.presses)
    dataset.FrameIncrementPointer = _FRAME_TIME_VECTOR
    dataset.FrameTimeVector = _increments_ms(stack.presses)
    # Required for multiple frames: an image file may contain text, a camera frame does not.
    dataset.BurnedInAnnotation = "NO" if all(from_camera(press) for press in stack.presses) else "YES"
    dataset.RescaleIntercept, dataset.RescaleSlope, dataset.RescaleType = "0", "1", "US"


def _estimate_group(stored: StoredEstimate, cover: ExportIdentity, sources: Sequence[Dataset]) -> Any:
    """An estimate, without numbers where it is untrusted.

    A parameter that is not identified has percentiles, but no mean and no standard deviation.
    """
    sr, estimate = _highdicom("sr"), stored.estimate
    trusted = concept(_YES if estimate.trusted else _NO)
    group = sr.MeasurementsAndQualitativeEvaluations(
        tracking_identifier=_tracking(f"estimate of {stored.kind}", cover, stored.id),
        method=_own("imaging"),
        algorithm_id=_algorithm(stored),
        measurements=_numbers(estimate),
        qualitative_evaluations=[sr.QualitativeEvaluation(name=_own("trusted"), value=trusted)],
        source_images=[
            sr.SourceImageForMeasurementGroup(source.SOPClassUID, source.SOPInstanceUID) for source in sources
        ],
    )
    for name, text in _statements(estimate):
        group[0].ContentSequence.append(_text(name, text))
    return group


def _numbers(estimate: Estimate) -> list[Any]:
    numbers = []
    for name in estimate.names if estimate.trusted else ():
        if name in _PARAMETERS:
            low, high = estimate.interval(INTERVAL_LEVEL)[name]
            moments = ((_MEAN, estimate.mean), (_STANDARD_DEVIATION, estimate.sd))
            values = [(code, values[name]) for code, values in moments if name in values]
            values += [(_FIFTH_PERCENTILE, low), (_NINETY_FIFTH_PERCENTILE, high)]
            numbers += [_number(_PARAMETERS[name], value, derivation) for derivation, value in values]
    if estimate.printed_presence is not None:
        numbers.append(_number((_PROBABILITY, _UNITLESS, "presence"), estimate.printed_presence, None))
    return numbers


def _number(kind: tuple[Any, Any, str | None], value: float, derivation: tuple[str, str, str] | None) -> Any:
    name, unit, method = kind
    return _highdicom("sr").Measurement(
        name=concept(name),
        value=float(f"{value:.6g}"),
        unit=concept(unit),
        method=_own(method) if method else None,
        derivation=concept(derivation) if derivation else None,
    )


def _statements(estimate: Estimate) -> list[tuple[str, str]]:
    """Texts by our codes; the message on identifiability contains numbers, so an untrusted estimate has another."""
    numbered = {name for name in estimate.names if name in _PARAMETERS and not estimate.withheld_reason(name)}
    statements = [("no-number", name) for name in estimate.names if name not in numbered]
    statements += [("flag", flag) for flag in estimate.flags]
    statements.append(("identifiability", estimate.printed_identifiability))
    statements.append(("prior", estimate.prior))
    return [(name, text) for name, text in statements if text.strip()]


def _press_group(press: StoredPress, cover: ExportIdentity, source: Dataset, frame: int) -> Any:
    """Force, role and flags of a press with its frame."""
    sr = _highdicom("sr")
    frames = [frame] if "NumberOfFrames" in source else None
    group = sr.MeasurementsAndQualitativeEvaluations(
        tracking_identifier=_tracking(f"press {ROLE_NAMES[press.role]}", cover, press.id or press.frame),
        method=_own("imaging"),
        measurements=[sr.Measurement(name=concept(_FORCE), value=float(press.force_n), unit=concept(_NEWTON))]
        if press.force_n is not None
        else [],
        source_images=[sr.SourceImageForMeasurementGroup(source.SOPClassUID, source.SOPInstanceUID, frames)],
    )
    for name, text in [("role", press.role), *(("flag", flag) for flag in press.flags)]:
        group[0].ContentSequence.append(_text(name, text))
    return group


def _text(name: str, text: str) -> Any:
    """A text item under our code ``name``."""
    sr = _highdicom("sr")
    return sr.TextContentItem(name=_own(name), value=text, relationship_type=sr.RelationshipTypeValues.CONTAINS)


def _tracking(what: str, cover: ExportIdentity, identity: str) -> Any:
    return _highdicom("sr").TrackingIdentifier(uid=deterministic_uid("tracking", cover.key, identity), identifier=what)


def _algorithm(stored: StoredEstimate) -> Any:
    """The program and code that computed the estimate, which may differ from the exporting program."""
    environment: Mapping[str, Any] = stored.environment
    code = environment.get("code_sha256")
    return _highdicom("sr").AlgorithmIdentification(
        name=f"tsis {stored.kind}",
        version=_dicom_line(str(environment.get("tsis") or stored.estimate.provenance.get("tsis") or __version__)),
        parameters=[f"code_sha256={_dicom_line(str(code))}"] if code else None,
    )


_SERIES = 9

# Attributes with the present time, which would make equal exports differ.
_OF_NOW = ("InstanceCreationDate", "InstanceCreationTime", "ContributingEquipmentSequence")


def set_moment(dataset: Dataset, date: str = "19000101", time: str = "000000") -> None:
    """Set the time of an instance of highdicom, and remove the present one; the default marks a removed time."""
    for what in _OF_NOW:
        del dataset[what]
    dataset.ContentDate, dataset.ContentTime = date, time


def _has_report(record: TargetRecord) -> bool:
    """Whether there is an estimate, a force, or a flag to report."""
    return bool(record.estimates) or any(press.force_n is not None or press.flags for press in record.presses)


def _report(record: TargetRecord, cover: ExportIdentity, images: Sequence[tuple[_Stack, Dataset]]) -> Dataset:
    """The report on the exported images, still without a UID."""
    made = max([stored.made for stored in record.active_estimates] or [press.taken for press in record.presses])
    moment = cover.moment(made) or ()
    sr = _highdicom("sr")
    document: Dataset = sr.ComprehensiveSR(
        evidence=[image for _, image in images],
        content=_content(record, cover, images)[0],
        series_instance_uid=deterministic_uid("series", cover.key, "report"),
        series_number=_SERIES,
        sop_instance_uid=deterministic_uid("unsealed"),
        instance_number=1,
        manufacturer="tsis",
        is_complete=True,
        coding_schemes=coding_schemes(),
    )
    described = "Estimate and forces, research use only"
    describe(document, cover, Series(number=_SERIES, what="report", description=described, modality="SR", started=made))
    set_moment(document, *moment)
    return document


def _content(record: TargetRecord, cover: ExportIdentity, images: Sequence[tuple[_Stack, Dataset]]) -> Any:
    sr = _highdicom("sr")
    positions = {  # by object: two presses may have the same frame, and presses outside a store have no identity
        id(press): (image, number) for stack, image in images for number, press in enumerate(stack.presses, 1)
    }
    groups = [
        _estimate_group(stored, cover, [image for stack, image in images if stack.contains(stored.presses)])
        for stored in record.active_estimates
    ]
    groups += [
        _press_group(press, cover, *positions[id(press)])
        for press in record.presses
        if press.force_n is not None or press.flags
    ]
    content = sr.MeasurementReport(
        observation_context=_observer(),
        procedure_reported=_own("imaging"),
        imaging_measurements=groups,
    )
    notice = _text("notice", RESEARCH_USE_ONLY)
    content[0].ContentSequence.insert(-1, notice)  # before any number
    return content


def _observer() -> Any:
    sr = _highdicom("sr")
    device = sr.DeviceObserverIdentifyingAttributes(
        uid=deterministic_uid("device", __version__), name="tsis", manufacturer_name="tsis", model_name=__version__
    )
    context = sr.ObserverContext(observer_type=concept(_DEVICE), observer_identifying_attributes=device)
    return sr.ObservationContext(observer_device_context=context)


def dicom_files(record: TargetRecord, *, identified: bool = False) -> tuple[DicomFile, ...]:
    """The instances of a target: Secondary Captures by role and probe of its presses, then a report.

    They are named ``tsis-<pseudonym>-<series>-<what>-<number>.dcm``.

    Equal records give equal bytes and UIDs with the same version. There is a report when there is an estimate, a force,
    or a flag of a press.

    Parameters
    ----------
    record
        The target with its presses and estimates.
    identified
        Whether to include the label of the target, the names of frames and the times. Otherwise the record is
        de-identified (`tsis.records.deidentification`). Notes and camera settings are never exported.

    Raises
    ------
    RecordsError
        When there is no press, or a frame does not match its press.
    MissingExtraError
        When the libraries of the extra ``dicom`` are not installed.
    """
    if not record.presses:
        raise RecordsError(f"target {record.target.number} must have at least one press to be exported; got none")
    exported, cover = _export_identity(record, identified=identified)
    images, files = [], []
    for stack in _stacks(exported):
        image = _capture(stack, cover)
        files.append(sealed(image, f"{cover.file_stem}-{stack.series}-{stack.role}-{stack.number:02d}.dcm"))
        images.append((stack, image))
    if _has_report(exported):
        files.append(sealed(_report(exported, cover, images), f"{cover.file_stem}-9-report-01.dcm"))
    return tuple(files)


def write_dicom(record: TargetRecord, folder: Path, *, identified: bool = False) -> tuple[Path, ...]:
    """Write the instances of `dicom_files` into a folder and return the paths; errors as these two functions."""
    return _write_files(dicom_files(record, identified=identified), folder)


def _write_files(files: Iterable[DicomFile], folder: Path) -> tuple[Path, ...]:
    """Write all files or none, except those that exist with the same content.

    `RecordsError` when a file cannot be written, or exists with other content.
    """
    folder = Path(folder)
    planned = {file.name: file.content for file in files}
    try:
        there = {name for name in planned if (folder / name).exists()}
        for name in sorted(there):
            if (folder / name).read_bytes() != planned[name]:
                raise RecordsError(
                    f"{folder / name} is there with another content, which an export does not replace; name an empty "
                    "folder"
                )
        add_files(folder, {name: content for name, content in planned.items() if name not in there})
    except OSError as error:
        raise RecordsError(f"the DICOM files cannot be written to {folder}: {error.strerror or error}") from error
    return tuple(folder / name for name in planned)
