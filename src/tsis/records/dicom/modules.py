"""The attributes that every instance has: patient, study, series, equipment, and what was taken out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.records.dicom.cover import dicom_line
from tsis.records.dicom.files import deterministic_uid
from tsis.records.dicom.libraries import pydicom

if TYPE_CHECKING:
    from datetime import datetime

    from pydicom.dataset import Dataset

    from tsis.records.dicom.cover import ExportIdentity

# PS3.16 CID 7050: the profile, and what we keep because it is written by this program and cleaned.
METHODS = (
    ("113100", "Basic Application Confidentiality Profile"),
    ("113104", "Clean Structured Content Option"),
    ("113105", "Clean Descriptors Option"),
)
METHOD_TEXT = ("Pseudonym for name and ID", "Dates and times removed", "New UIDs", "No free text, names or settings")


@dataclass(frozen=True, slots=True, kw_only=True)
class Series:
    """What the instances of one series share.

    Parameters
    ----------
    number
        In the study, from 1.
    what
        What UIDs tell it from others by, e.g. role and probe of the presses.
    description
        What people read in an archive.
    modality
        ``"OT"`` for images, ``"SR"`` for reports.
    started
        Time of its first instance.
    """

    number: int
    what: str
    description: str
    modality: str
    started: datetime


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
