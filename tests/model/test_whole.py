"""Files and folders that appear whole or not at all."""

from __future__ import annotations

import errno
import os
from typing import TYPE_CHECKING

import pytest

from tsis.files.atomic import Disk, add_files, atomic_file, atomic_folder

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


class FullDisk(Disk):
    """Fails at the step of a number, counted from 1, and lists the steps it took."""

    def __init__(self, at: int = 0) -> None:
        self.at, self.steps = at, list[str]()

    def _step(self, what: str) -> None:
        self.steps.append(what)
        if len(self.steps) == self.at:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def sync_again(self, path: Path) -> None:
        self._step(f"sync {path.name}")
        super().sync_again(path)

    def rename(self, draft: Path, path: Path) -> None:
        self._step(f"name {path.name}")
        super().rename(draft, path)

    def name(self, draft: Path, path: Path) -> None:
        self._step(f"name {path.name}")
        super().name(draft, path)


@pytest.fixture(params=[0o022, 0o027, 0o077])
def mask(request: pytest.FixtureRequest) -> Iterator[int]:
    before = os.umask(request.param)
    yield request.param
    os.umask(before)


def fill(draft: Path) -> None:
    (draft / "in").mkdir()
    (draft / "in" / "one").write_bytes(b"1")
    (draft / "two").write_bytes(b"22")


def test_the_users_mask_says_who_may_read(tmp_path: Path, mask: int) -> None:
    with atomic_folder(tmp_path / "folder") as draft:
        fill(draft)
    with atomic_file(tmp_path / "file") as draft:
        draft.write_bytes(b"1")
    add_files(tmp_path / "added", {"one": b"1"})
    add_files(tmp_path / "added", {"two": b"2"})
    for path in tmp_path.rglob("*"):
        assert path.stat().st_mode & 0o777 == (0o777 if path.is_dir() else 0o666) & ~mask


def test_all_is_synced_before_it_gets_its_name(tmp_path: Path) -> None:
    disk = FullDisk()
    with atomic_folder(tmp_path / "folder", disk=disk) as draft:
        fill(draft)
        assert not (tmp_path / "folder").exists()
    assert sorted(disk.steps[:-1]) == ["sync one", "sync two"]
    assert disk.steps[-1] == "name folder"
    assert [path.name for path in tmp_path.iterdir()] == ["folder"]


@pytest.mark.parametrize("at", [1, 2, 3])
def test_a_folder_that_fails_at_any_step_is_not_there(tmp_path: Path, at: int) -> None:
    with pytest.raises(OSError, match="No space left"), atomic_folder(tmp_path / "folder", disk=FullDisk(at)) as draft:
        fill(draft)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("at", [1, 2])
def test_a_file_that_fails_at_any_step_is_not_there(tmp_path: Path, at: int) -> None:
    with pytest.raises(OSError, match="No space left"), atomic_file(tmp_path / "file", disk=FullDisk(at)) as draft:
        draft.write_bytes(b"1")
    assert list(tmp_path.iterdir()) == []


def test_whatever_ends_the_block_leaves_nothing(tmp_path: Path) -> None:
    def stop(draft: Path) -> None:
        fill(draft)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), atomic_folder(tmp_path / "a" / "folder") as draft:
        stop(draft)
    assert list((tmp_path / "a").iterdir()) == []


def test_a_folder_that_came_meanwhile_is_left(tmp_path: Path) -> None:
    def race(draft: Path) -> None:
        fill(draft)
        (tmp_path / "it").mkdir()

    with pytest.raises(FileExistsError), atomic_folder(tmp_path / "it") as draft:
        race(draft)
    assert list(tmp_path.rglob("*")) == [tmp_path / "it"]


def test_a_file_that_came_meanwhile_is_left(tmp_path: Path) -> None:
    def race(draft: Path) -> None:
        draft.write_bytes(b"1")
        (tmp_path / "it").write_bytes(b"mine")

    with pytest.raises(FileExistsError), atomic_file(tmp_path / "it") as draft:
        race(draft)
    assert [(path.name, path.read_bytes()) for path in tmp_path.iterdir()] == [("it", b"mine")]


def test_all_files_are_added_or_none(tmp_path: Path) -> None:
    (tmp_path / "two").write_bytes(b"mine")
    with pytest.raises(FileExistsError):
        add_files(tmp_path, {"one": b"1", "two": b"2"})
    assert [(path.name, path.read_bytes()) for path in tmp_path.iterdir()] == [("two", b"mine")]
    add_files(tmp_path, {"one": b"1", "three": b"3"})
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"one": b"1", "two": b"mine", "three": b"3"}
