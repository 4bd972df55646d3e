"""Codes of SNOMED CT, DICOM, UCUM and our scheme, and the common attributes of instances."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.records.dicom._files import deterministic_uid, highdicom, pydicom
from tsis.records.dicom._identity import dicom_line

if TYPE_CHECKING:
    from datetime import datetime

    from pydicom.dataset import Dataset

    from tsis.records.dicom._identity import ExportIdentity


SCHEME = "99TSIS"
SCHEME_NAME = "Codes of tsis, open software for optical tactile imaging"

# Our codes: value -> meaning.
OWN = MappingProxyType(
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
MILLIMETRE, KILOPASCAL, NEWTON, UNITLESS = (
    ("mm", "UCUM", "millimeter"),
    ("kPa", "UCUM", "kilopascal"),
    ("N", "UCUM", "newton"),
    ("1", "UCUM", "no units"),
)
DIAMETER = ("81827009", "SCT", "Diameter")
DEPTH = ("131197000", "SCT", "Depth")
ELASTICITY = ("110830", "DCM", "Elasticity")
FORCE = ("111647", "DCM", "Compression Force")
PROBABILITY = ("122157", "DCM", "Probability")
MEAN = ("373098007", "SCT", "Mean")
STANDARD_DEVIATION = ("386136009", "SCT", "Standard Deviation")
FIFTH_PERCENTILE = ("371888009", "SCT", "Fifth percentile")
NINETY_FIFTH_PERCENTILE = ("371889001", "SCT", "Ninety-fifth percentile")
DEVICE = ("121007", "DCM", "Device")
YES, NO = ("373066001", "SCT", "Yes"), ("373067005", "SCT", "No")

# Parameter of an estimate -> concept, unit, and the method where the concept is not precise.
PARAMETERS = MappingProxyType(
    {
        "diameter_mm": (DIAMETER, MILLIMETRE, None),
        "depth_mm": (DEPTH, MILLIMETRE, None),
        "young_kpa": (ELASTICITY, KILOPASCAL, "young"),
    }
)


def concept(triple: tuple[str, str, str]) -> Any:
    """A code of value, scheme and meaning for highdicom."""
    value, scheme, meaning = triple
    return highdicom("sr").CodedConcept(value=value, scheme_designator=scheme, meaning=meaning)


def own(value: str) -> Any:
    """One of our own codes."""
    return concept((value, SCHEME, OWN[value]))


# PS3.16 CID 7050: the profile and its options.
METHODS = (
    ("113100", "Basic Application Confidentiality Profile"),
    ("113104", "Clean Structured Content Option"),
    ("113105", "Clean Descriptors Option"),
)
METHOD_TEXT = ("Pseudonym for name and ID", "Dates and times removed", "New UIDs", "No free text, names or settings")


@dataclass(frozen=True, slots=True, kw_only=True)
class Series:
    """The common attributes of a series."""

    number: int  # in the study, from 1
    what: str  # source of its UID, e.g. role and probe of the presses
    description: str
    modality: str  # "OT" for images, "SR" for reports
    started: datetime  # time of its first instance


def code(value: str, scheme: str, meaning: str) -> Dataset:
    """An item of a code sequence."""
    item: Dataset = pydicom().Dataset()
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
    dataset.SeriesDescription = dicom_line(series.description)
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
        dataset.DeidentificationMethod = list(METHOD_TEXT)
        dataset.DeidentificationMethodCodeSequence = [code(value, "DCM", meaning) for value, meaning in METHODS]
        dataset.LongitudinalTemporalInformationModified = "REMOVED"
