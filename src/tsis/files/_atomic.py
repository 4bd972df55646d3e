"""Files that are whole or absent, whenever the machine or the program stops."""

from __future__ import annotations

import errno
import os
import secrets
import shutil
import sys
import time
from contextlib import contextmanager, suppress
from typing import IO, TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path


UNFINISHED = ".unfinished"
PRIVATE_FILE, PRIVATE_FOLDER = 0o600, 0o700  # modes that let in the owner alone
_NO_LINKS = (errno.EPERM, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP)  # of file systems as that of memory cards

if sys.platform == "darwin":
    import fcntl

    def _sync(handle: int) -> None:
        """Sync a file; macOS' own fsync leaves it in the drive's cache."""
        try:
            fcntl.fcntl(handle, fcntl.F_FULLFSYNC)
        except OSError:  # a file system that has no such call
            os.fsync(handle)

else:
    _sync = os.fsync


def _open_private(path: str, flags: int) -> int:
    return os.open(path, flags, PRIVATE_FILE)


class Disk:
    """Every step by which a file gets onto the disk, one call a step, so that a test can make any of them fail."""

    def create(self, path: Path, *, private: bool = False) -> IO[bytes]:
        """Create an empty file and open it for writing; `FileExistsError` where there is one.

        A private file has mode 0600 from the start.
        """
        return open(path, "xb", opener=_open_private if private else None)

    def write(self, file: IO[bytes], content: bytes) -> None:
        """Hand the content to the operating system."""
        file.write(content)
        file.flush()

    def sync(self, file: IO[bytes]) -> None:
        """Return when what was written to the file is on the disk."""
        _sync(file.fileno())

    def sync_again(self, path: Path) -> None:
        """Return when a file that somebody else wrote is on the disk, whether it already was or not."""
        with path.open("rb" if os.name == "posix" else "r+b") as file:
            self.sync(file)

    def reopen(self, path: Path) -> IO[bytes]:
        """Open a file that there is for more writing."""
        return path.open("r+b")

    def read_from(self, path: Path, start: int) -> bytes:
        """The content of a file from a place on."""
        with path.open("rb") as file:
            file.seek(start)
            return file.read()

    def rename(self, draft: Path, path: Path) -> None:
        """Give the file its name, in place of what had it."""
        draft.replace(path)

    def name(self, draft: Path, path: Path) -> None:
        """Give the file its name, which nothing has yet; `FileExistsError` where something has it."""
        try:
            path.hardlink_to(draft)
        except FileExistsError:
            raise
        except OSError as error:
            if error.errno not in _NO_LINKS or path.exists():
                raise
            draft.replace(path)
        else:
            draft.unlink()

    def sync_folder(self, folder: Path) -> None:
        """Return when the names in the folder are on the disk."""
        # A rename lasts only when the folder itself is on the disk; other systems have no such call.
        if os.name == "posix":
            handle = os.open(folder, os.O_RDONLY)
            try:
                _sync(handle)
            finally:
                os.close(handle)

    def make_folder(self, folder: Path, *, private: bool = False) -> None:
        """Make a folder where there is none; a private one has mode 0700."""
        folder.mkdir(mode=PRIVATE_FOLDER if private else 0o777, exist_ok=True)

    def remove(self, path: Path) -> None:
        """Take a file away."""
        path.unlink()


DISK = Disk()


def write_durably(
    path: Path,
    content: bytes,
    *,
    disk: Disk = DISK,
    drafts: Path | None = None,
    replace: bool = True,
    private: bool = False,
) -> None:
    """Write ``content``; when this returns it is on the disk, and readers never see a part of it.

    Parameters
    ----------
    path, content
        Which file, and all of what it shall hold.
    disk
        By which steps it gets there.
    drafts
        Folder of the same disk in which it is written before it gets its name; by default that of ``path``.
    replace
        Whether it may take the place of what has that name.
    private
        Whether its owner alone may read it.

    Raises
    ------
    OSError
        When it cannot be written, or nobody knows whether it would last. Then either nothing is left of it, or, where
        only the folder could not be synced, all of it. `FileExistsError` when the name is taken.
    """
    draft = (drafts or path.parent) / f".{path.name}-{secrets.token_hex(8)}{UNFINISHED}"
    try:
        with disk.create(draft, private=private) as file:
            disk.write(file, content)
            disk.sync(file)
        if replace:
            disk.rename(draft, path)
        else:
            disk.name(draft, path)
    except BaseException:
        with suppress(OSError):
            disk.remove(draft)
        raise
    disk.sync_folder(path.parent)


def append_durably(path: Path, content: bytes, *, after: int | None = None, disk: Disk = DISK) -> None:
    """Write ``content`` at the end of a file; when this returns it is on the disk.

    Parameters
    ----------
    path, content
        Which file, and what to add to it.
    after
        How many of its bytes stay; None for all of them.
    disk
        By which steps it gets there.

    Raises
    ------
    OSError
        When it cannot be written; then the file ends as before. A power loss may leave a part of ``content``.
    """
    with disk.reopen(path) as file:
        end = file.seek(0, os.SEEK_END) if after is None else file.seek(after)
        try:
            file.truncate()
            disk.write(file, content)
            disk.sync(file)
        except BaseException:
            with suppress(OSError):
                file.truncate(end)
            raise


def make_folder_durably(folder: Path, *, disk: Disk = DISK, private: bool = False) -> None:
    """Make a folder and those above it that are missing; when this returns they are on the disk.

    Those that were there are synced too: who made them may have been killed before they lasted. Of a private folder
    the missing parents are private as well.

    Raises
    ------
    OSError
        When one cannot be made.
    """
    folder = folder.absolute()
    for parent in (*reversed(folder.parents), folder):
        created = not parent.is_dir()
        if created:
            disk.make_folder(parent, private=private)
        try:
            disk.sync_folder(parent.parent)
        except OSError:
            if created or parent == folder:  # others, up to the root, need not let themselves be synced
                raise


def remove_unfinished(folder: Path, *, age_s: float = 0.0) -> None:
    """Remove what killed writers left, where it is at least as old as a living one would let it become."""
    for draft in folder.glob(f".*{UNFINISHED}"):
        with suppress(OSError):
            if time.time() - draft.stat().st_mtime >= age_s:
                draft.unlink()


@contextmanager
def atomic_file(requested: Path, *, disk: Disk = DISK) -> Iterator[Path]:
    """A draft to write beside ``requested``; it gets that name when the block ends well, else nothing is left.

    Raises
    ------
    FileExistsError
        When there is something of that name.
    OSError
        When it cannot be written.
    """
    draft = _draft_of(requested, disk)
    try:
        yield draft
        disk.sync_again(draft)
        disk.name(draft, requested)
    except BaseException:
        with suppress(OSError):
            disk.remove(draft)
        raise
    disk.sync_folder(requested.parent)


@contextmanager
def atomic_folder(requested: Path, *, disk: Disk = DISK) -> Iterator[Path]:
    """A folder to fill beside ``requested``; it gets that name when the block ends well, else nothing is left.

    When the block has ended, all that is in it is on the disk.

    Raises
    ------
    FileExistsError
        When there is something of that name.
    OSError
        When it cannot be written.
    """
    draft = _draft_of(requested, disk)
    draft.mkdir()  # others may read it as they may read any new folder: the user's mask says
    try:
        yield draft
        for path in sorted(draft.rglob("*")):
            if path.is_dir():
                disk.sync_folder(path)
            else:
                disk.sync_again(path)
        disk.sync_folder(draft)
        _require_new(requested)  # a rename would take the place of an empty folder
        disk.rename(draft, requested)
    except BaseException:
        shutil.rmtree(draft, ignore_errors=True)
        raise
    disk.sync_folder(requested.parent)


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


def _draft_of(requested: Path, disk: Disk) -> Path:
    _require_new(requested)
    if not requested.parent.is_dir():
        make_folder_durably(requested.parent, disk=disk)
    return requested.with_name(f".{requested.name}-{secrets.token_hex(8)}{UNFINISHED}")


def _require_new(requested: Path) -> None:
    if requested.name in ("", "..") or os.path.lexists(requested):
        raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(requested))
