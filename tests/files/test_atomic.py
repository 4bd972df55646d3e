"""Files and folders that appear whole or not at all; locks as POSIX and Windows have them, whose call is imitated."""

from __future__ import annotations

import errno
import os
import sys
import threading
from types import SimpleNamespace
from typing import TYPE_CHECKING

import pytest

from tsis.files import atomic
from tsis.files.atomic import Disk, add_files, atomic_file, atomic_folder, exclusive_lock

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


class Windows:
    """The C library's locks of Windows: a byte of a file, one owner; another is refused, or gives up after a while."""

    LK_LOCK, LK_NBLCK, LK_UNLCK = 1, 2, 0

    def __init__(self) -> None:
        self.owners: dict[int, int] = {}
        self.asked_in_vain = threading.Event()

    def locking(self, handle: int, mode: int, _count: int) -> None:
        file = os.fstat(handle).st_ino
        if mode == self.LK_UNLCK:
            assert self.owners.pop(file) == handle
        elif self.owners.setdefault(file, handle) != handle:
            self.asked_in_vain.set()
            raise PermissionError(errno.EACCES, "") if mode == self.LK_NBLCK else OSError(errno.EDEADLOCK, "")


@pytest.fixture(params=["posix", "windows"])
def system(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[SimpleNamespace]:
    windows = Windows()
    if request.param == "windows":
        monkeypatch.setattr(atomic, "LOCKS_ARE_BYTES", True)
        monkeypatch.setitem(sys.modules, "msvcrt", windows)
    return SimpleNamespace(name=request.param, windows=windows)


@pytest.mark.parametrize("kind", ["file", "folder"])
def test_one_owner_at_a_time(system: SimpleNamespace, tmp_path: Path, kind: str) -> None:
    path = tmp_path / "of"
    path.mkdir() if kind == "folder" else path.write_bytes(b"log")
    with exclusive_lock(path, wait=False):
        with pytest.raises(BlockingIOError), exclusive_lock(path, wait=False):
            pass
        with exclusive_lock(tmp_path, wait=False):
            pass
    with exclusive_lock(path, wait=False):
        pass
    if kind == "file":
        assert path.read_bytes() == b"log"
    assert (tmp_path / "of.lock").exists() == (system.name == "windows")


def test_who_waits_gets_the_lock(system: SimpleNamespace, tmp_path: Path) -> None:
    order = []

    def second() -> None:
        with exclusive_lock(tmp_path, wait=True):
            order.append("second")

    with exclusive_lock(tmp_path, wait=True):
        other = threading.Thread(target=second)
        other.start()
        if system.name == "windows":
            system.windows.asked_in_vain.wait()
        order.append("first")
    other.join()
    assert order == ["first", "second"]


def test_what_is_not_there_is_not_locked(system: SimpleNamespace, tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError), exclusive_lock(tmp_path / "nowhere", wait=False):
        pass
    assert list(tmp_path.iterdir()) == []
    assert system.windows.owners == {}
