"""Files of an export: whole or absent, and never another in the place of one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pydicom
import pytest
from tests.records.sample import sample_record

from tsis.errors import MissingExtraError, RecordsError
from tsis.files import atomic as durable
from tsis.records.dicom import dicom_files, write_dicom

if TYPE_CHECKING:
    from pathlib import Path


def test_files_are_named_by_a_pattern(tmp_path: Path) -> None:
    record = sample_record()
    names = [path.name for path in write_dicom(record, tmp_path / "new" / "folder")]
    stem = pydicom.dcmread(tmp_path / "new" / "folder" / names[0]).PatientID.lower()
    assert names == [f"{stem}-1-target-01.dcm", f"{stem}-2-plain-01.dcm", f"{stem}-9-report-01.dcm"]
    result = [path.name for path in write_dicom(record, tmp_path, identified=True)]
    assert result == ["tsis-00003-1-target-01.dcm", "tsis-00003-2-plain-01.dcm", "tsis-00003-9-report-01.dcm"]


def test_writing_again_changes_nothing(tmp_path: Path) -> None:
    first = [(path, path.read_bytes(), path.stat().st_ino) for path in write_dicom(sample_record(), tmp_path)]
    again = [(path, path.read_bytes(), path.stat().st_ino) for path in write_dicom(sample_record(), tmp_path)]
    assert first == again


def test_another_content_of_the_name_is_not_replaced(tmp_path: Path) -> None:
    path = write_dicom(sample_record(), tmp_path)[1]
    path.write_bytes(b"mine")
    for other in set(tmp_path.iterdir()) - {path}:
        other.unlink()
    with pytest.raises(RecordsError, match="is there with another content"):
        write_dicom(sample_record(), tmp_path)
    assert list(tmp_path.iterdir()) == [path]
    assert path.read_bytes() == b"mine"


@pytest.mark.parametrize("step", ["sync", "name"])
@pytest.mark.parametrize("at", [1, 2, 3])
def test_a_disk_that_fails_at_any_file_leaves_no_half_of_a_set(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str, at: int
) -> None:
    (tmp_path / "mine").write_bytes(b"mine")
    done: list[str] = []
    real = getattr(durable.Disk, step)

    def fail(*known: object) -> None:
        done.append("")
        if len(done) == at:
            raise OSError(28, "No space left on device")
        real(*known)

    monkeypatch.setattr(durable.Disk, step, fail)
    with pytest.raises(RecordsError, match=r"cannot be written to .*: No space left on device"):
        write_dicom(sample_record(), tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]
    monkeypatch.undo()
    assert len(write_dicom(sample_record(), tmp_path)) == 3


def test_a_new_folder_is_not_there_when_the_disk_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(durable.Disk, "sync", fail)
    with pytest.raises(RecordsError, match="No space left on device"):
        write_dicom(sample_record(), tmp_path / "new")
    assert list(tmp_path.iterdir()) == []


def test_what_is_missing_of_a_set_is_written_and_the_rest_left(tmp_path: Path) -> None:
    paths = write_dicom(sample_record(), tmp_path)
    content, kept = paths[1].read_bytes(), paths[0].stat()
    paths[1].unlink()
    assert write_dicom(sample_record(), tmp_path) == paths
    assert paths[1].read_bytes() == content
    assert (paths[0].stat().st_ino, paths[0].stat().st_mtime_ns) == (kept.st_ino, kept.st_mtime_ns)


def test_a_folder_that_is_a_file_is_told(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    with pytest.raises(RecordsError, match="cannot be written to"):
        write_dicom(sample_record(), tmp_path / "taken")


def test_a_missing_library_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pydicom", None)
    with pytest.raises(MissingExtraError, match=r"DICOM needs pydicom.*tsis\[dicom\]"):
        dicom_files(sample_record())
