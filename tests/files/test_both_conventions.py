"""Locks and paths under the conventions of POSIX and of Windows, whose lock call is imitated here."""

from __future__ import annotations

import errno
import os
import sys
import threading
from pathlib import PureWindowsPath
from types import SimpleNamespace
from typing import TYPE_CHECKING

import pytest

from tsis.errors import InputError
from tsis.files import atomic
from tsis.files.atomic import exclusive_lock
from tsis.files.frame_names import require_file_stem
from tsis.records import target as bundle
from tsis.sweep import shards

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


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


TRICKS = (
    *("..\\up", "C:x", "C:\\x", "\\\\server\\share", "a\\b", "a/b", "../up", "/root", "a:stream", "a.", "a ", "a\0b"),
    *("con", "NUL", "com1", "Lpt9", "aux", "a*", "a?", "a<b", 'a"b', "a|b", ""),
)


@pytest.mark.parametrize("name", TRICKS)
def test_no_name_leads_elsewhere_on_either_system(name: str) -> None:
    """Names that files give to files: of targets and snapshots, in bundles, of a sweep's parts."""
    with pytest.raises(InputError):
        require_file_stem(name)
    assert not any(pattern.fullmatch(f"frames/{name}.png") for pattern in bundle.LARGEST)
    assert shards.NAME.fullmatch(name) is None


@pytest.mark.parametrize("name", ["Target", "a-1_b", "Z" * 40])
def test_good_names_are_one_part_and_no_device_on_windows(name: str) -> None:
    path = PureWindowsPath(require_file_stem(name))
    assert path.parts == (name,)
    assert not path.is_reserved()
