"""Files that are whole or absent, whenever the machine or the program stops."""

from __future__ import annotations

import os
import secrets
from contextlib import suppress
from typing import IO, TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

UNFINISHED = ".unfinished"


class Disk:
    """Every step by which a file gets onto the disk, one call a step, so that a test can make any of them fail."""

    def create(self, path: Path) -> IO[bytes]:
        """A new empty file, open for writing; `FileExistsError` where there is one."""
        return path.open("xb")

    def write(self, file: IO[bytes], content: bytes) -> None:
        """Hand the content to the operating system."""
        file.write(content)
        file.flush()

    def sync(self, file: IO[bytes]) -> None:
        """Return when what was written to the file is on the disk."""
        os.fsync(file.fileno())

    def rename(self, draft: Path, path: Path) -> None:
        """Give the file its name, in place of what had it."""
        draft.replace(path)

    def sync_folder(self, folder: Path) -> None:
        """Return when the names in the folder are on the disk."""
        # A rename lasts only when the folder itself is on the disk; other systems have no such call.
        if os.name == "posix":
            handle = os.open(folder, os.O_RDONLY)
            try:
                os.fsync(handle)
            finally:
                os.close(handle)

    def make_folder(self, folder: Path) -> None:
        """A new folder, or the one that is there."""
        folder.mkdir(exist_ok=True)

    def remove(self, path: Path) -> None:
        """Take a file away."""
        path.unlink()


DISK = Disk()


def write_durably(path: Path, content: bytes, *, disk: Disk = DISK) -> None:
    """Write ``content``; when this returns it is on the disk, and readers never see a part of it.

    Raises
    ------
    OSError
        When it cannot be written; nothing is left then.
    """
    draft = path.with_name(f".{path.name}-{secrets.token_hex(8)}{UNFINISHED}")
    try:
        with disk.create(draft) as file:
            disk.write(file, content)
            disk.sync(file)
        disk.rename(draft, path)
    except BaseException:
        with suppress(OSError):
            disk.remove(draft)
        raise
    disk.sync_folder(path.parent)


def make_folder_durably(folder: Path, *, disk: Disk = DISK) -> None:
    """Make a folder and those above it that are missing; when this returns they are on the disk.

    Raises
    ------
    OSError
        When one cannot be made.
    """
    if folder.parent != folder and not folder.parent.exists():
        make_folder_durably(folder.parent, disk=disk)
    disk.make_folder(folder)
    disk.sync_folder(folder.parent)


def remove_unfinished(folder: Path) -> None:
    """Remove what killed writers left."""
    for draft in folder.glob(f".*{UNFINISHED}"):
        with suppress(OSError):
            draft.unlink()
