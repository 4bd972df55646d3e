"""A dossier as DICOM instances: its frames, and a report on them."""

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
    """The instances of a target: one or more of Secondary Capture a role and probe of its presses, then a report.

    The same dossier gives the same bytes and UIDs whenever the same version exports it. The report is there when
    something is known to report: an estimate, forces, or flags of the presses.

    Parameters
    ----------
    record
        The target with its presses and estimates.
    identified
        Whether to tell the target's label, the names of frames and the true times. Otherwise a pseudonym stands for
        the target, dates are taken out, and `tsis.records._deidentify` says what else; notes and camera settings are
        in no export.

    Raises
    ------
    RecordsError
        When there is no press, or a frame is not what its press says.
    MissingExtraError
        When the libraries of the extra ``dicom`` are not installed.
    """
    if not record.presses:
        raise RecordsError(f"target {record.target.number} must have at least one press to be exported; got none")
    reported, cover = export_identity(record, identified=identified)
    images, files = [], []
    for stack in stacks(reported):
        image = capture(stack, cover)
        files.append(sealed(image, f"{cover.file_stem}-{stack.series}-{stack.role}-{stack.number:02d}.dcm"))
        images.append((stack, image))
    if has_report(reported):
        files.append(sealed(report(reported, cover, images), f"{cover.file_stem}-9-report-01.dcm"))
    return tuple(files)


def write_dicom(record: TargetRecord, folder: Path, *, identified: bool = False) -> tuple[Path, ...]:
    """Write what `dicom_files` makes into a folder, each file whole or not at all, and return the paths.

    Raises
    ------
    RecordsError
        As `dicom_files`; when a file cannot be written, or one of that name is there with another content.
    """
    return write_files(dicom_files(record, identified=identified), folder)
