from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tsis.errors import FileInputError
from tsis.files.result_folder import free_folder, write_folder

if TYPE_CHECKING:
    from pathlib import Path


def test_all_files_arrive(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "a" / "b", {"one": b"1", "two": b"22"})
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == {"one": b"1", "two": b"22"}
    assert folder.is_absolute()


def test_a_failure_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(FileInputError, match="must be a folder that can be made"):
        write_folder(tmp_path / "result", {"one": b"1", "no/such/folder": b"2"})
    assert list(tmp_path.iterdir()) == []


def test_an_empty_folder_is_never_replaced(tmp_path: Path) -> None:
    (tmp_path / "result").mkdir()
    with pytest.raises(FileInputError, match="exists"):
        write_folder(tmp_path / "result", {"one": b"1"})
    assert list(tmp_path.rglob("*")) == [tmp_path / "result"]


def test_an_existing_folder_with_files_is_never_replaced(tmp_path: Path) -> None:
    (tmp_path / "result").mkdir()
    (tmp_path / "result" / "mine").write_bytes(b"keep")
    with pytest.raises(FileInputError):
        write_folder(tmp_path / "result", {"mine": b"lost"})
    assert [(path.name, path.is_dir()) for path in tmp_path.iterdir()] == [("result", True)]
    assert (tmp_path / "result" / "mine").read_bytes() == b"keep"


def test_the_first_free_name_is_found(tmp_path: Path) -> None:
    names = []
    for _ in range(3):
        folder = free_folder(tmp_path / "press")
        folder.mkdir()
        names.append(folder.name)
    assert names == ["press", "press-2", "press-3"]
