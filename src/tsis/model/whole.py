"""Files, and folders of them, that appear whole or not at all, and never in the place of others."""

from __future__ import annotations

import errno
import os
import secrets
import shutil
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

from tsis.model.durable import DISK, UNFINISHED, Disk, make_folder_durably, write_durably

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path


@contextmanager
def atomic_file(wanted: Path, *, disk: Disk = DISK) -> Iterator[Path]:
    """A draft to write beside ``wanted``; it gets that name when the block ends well, else nothing is left.

    Raises
    ------
    FileExistsError
        When there is something of that name.
    OSError
        When it cannot be written.
    """
    draft = _draft_of(wanted, disk)
    try:
        yield draft
        disk.sync_again(draft)
        disk.name(draft, wanted)
    except BaseException:
        with suppress(OSError):
            disk.remove(draft)
        raise
    disk.sync_folder(wanted.parent)


@contextmanager
def atomic_folder(wanted: Path, *, disk: Disk = DISK) -> Iterator[Path]:
    """A folder to fill beside ``wanted``; it gets that name when the block ends well, else nothing is left.

    When the block has ended, all that is in it is on the disk.

    Raises
    ------
    FileExistsError
        When there is something of that name.
    OSError
        When it cannot be written.
    """
    draft = _draft_of(wanted, disk)
    draft.mkdir()  # others may read it as they may read any new folder: the user's mask says
    try:
        yield draft
        for each in sorted(draft.rglob("*")):
            if each.is_dir():
                disk.sync_folder(each)
            else:
                disk.sync_again(each)
        disk.sync_folder(draft)
        _require_new(wanted)  # a rename would take the place of an empty folder
        disk.rename(draft, wanted)
    except BaseException:
        shutil.rmtree(draft, ignore_errors=True)
        raise
    disk.sync_folder(wanted.parent)


def add_files(folder: Path, files: Mapping[str, bytes], *, disk: Disk = DISK) -> None:
    """Put all ``files`` (name -> bytes) into a folder, which is made where it is missing, or none of them.

    They get their names when the last of them is on the disk. Only where the power goes while they get them, some may
    have theirs and others not.

    Raises
    ------
    FileExistsError
        When there is something of one of the names.
    OSError
        When one cannot be written.
    """
    if not os.path.lexists(folder):
        with atomic_folder(folder, disk=disk) as draft:
            for name, content in files.items():
                (draft / name).write_bytes(content)
        return
    if not files:
        return
    given: list[Path] = []
    draft = _draft_of(folder / "files", disk)
    draft.mkdir()
    try:
        for name, content in files.items():
            write_durably(draft / name, content, disk=disk)
        for name in files:
            disk.name(draft / name, folder / name)
            given.append(folder / name)
        disk.sync_folder(folder)
    except BaseException:
        for path in given:
            with suppress(OSError):
                disk.remove(path)
        raise
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def _draft_of(wanted: Path, disk: Disk) -> Path:
    _require_new(wanted)
    if not wanted.parent.is_dir():
        make_folder_durably(wanted.parent, disk=disk)
    return wanted.with_name(f".{wanted.name}-{secrets.token_hex(8)}{UNFINISHED}")


def _require_new(wanted: Path) -> None:
    if wanted.name in ("", "..") or os.path.lexists(wanted):
        raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(wanted))
