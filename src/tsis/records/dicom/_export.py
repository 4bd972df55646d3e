"""Export of a target record as DICOM instances: its frames, and a report on them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.errors import RecordsError
from tsis.records.dicom._capture import capture, stacks
from tsis.records.dicom._files import DicomFile, sealed, write_files
from tsis.records.dicom._identity import export_identity
from tsis.records.dicom._report import has_report, report

if TYPE_CHECKING:
    from pathlib import Path

    from tsis.records._target_record import TargetRecord


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
