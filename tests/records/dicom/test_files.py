"""Files of an export: whole or absent, and never another in the place of one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pydicom
import pytest
from tests.records.sample import sample_dossier

from tsis.model import durable
from tsis.model.errors import MissingExtraError, RecordsError
from tsis.records.dicom import dicom_files, write_dicom

if TYPE_CHECKING:
    from pathlib import Path


def test_files_are_named_by_a_pattern(tmp_path: Path) -> None:
    dossier = sample_dossier()
    names = [path.name for path in write_dicom(dossier, tmp_path / "new" / "folder")]
    stem = pydicom.dcmread(tmp_path / "new" / "folder" / names[0]).PatientID.lower()
    assert names == [f"{stem}-1-target-01.dcm", f"{stem}-2-plain-01.dcm", f"{stem}-9-report-01.dcm"]
    told = [path.name for path in write_dicom(dossier, tmp_path, identified=True)]
    assert told == ["tsis-00003-1-target-01.dcm", "tsis-00003-2-plain-01.dcm", "tsis-00003-9-report-01.dcm"]


def test_writing_again_changes_nothing(tmp_path: Path) -> None:
    first = [(path, path.read_bytes(), path.stat().st_ino) for path in write_dicom(sample_dossier(), tmp_path)]
    again = [(path, path.read_bytes(), path.stat().st_ino) for path in write_dicom(sample_dossier(), tmp_path)]
    assert first == again


def test_another_content_of_the_name_is_not_replaced(tmp_path: Path) -> None:
    path = write_dicom(sample_dossier(), tmp_path)[1]
    path.write_bytes(b"mine")
    for other in set(tmp_path.iterdir()) - {path}:
        other.unlink()
    with pytest.raises(RecordsError, match="is there with another content"):
        write_dicom(sample_dossier(), tmp_path)
    assert list(tmp_path.iterdir()) == [path]
    assert path.read_bytes() == b"mine"


def test_a_full_disk_leaves_whole_files_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    wanted = {file.name: file.content for file in dicom_files(sample_dossier())}
    done: list[str] = []
    real = durable.Disk.sync

    def fail(self: durable.Disk, file: object) -> None:
        done.append("")
        if len(done) == 2:
            raise OSError(28, "No space left on device")
        real(self, file)  # type: ignore[arg-type]

    monkeypatch.setattr(durable.Disk, "sync", fail)
    with pytest.raises(RecordsError, match=r"cannot be written to .*: No space left on device"):
        write_dicom(sample_dossier(), tmp_path)
    left = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert len(left) == 1
    assert left.items() <= wanted.items()


def test_a_folder_that_is_a_file_is_told(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    with pytest.raises(RecordsError, match="cannot be written to"):
        write_dicom(sample_dossier(), tmp_path / "taken")


def test_a_missing_library_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pydicom", None)
    with pytest.raises(MissingExtraError, match=r"DICOM needs pydicom.*tsis\[dicom\]"):
        dicom_files(sample_dossier())
