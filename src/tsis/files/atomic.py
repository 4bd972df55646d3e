"""Atomic and durable writes, and locks of files: a file is whole or absent, whenever machine or program stops."""

from __future__ import annotations

import errno
import os
import secrets
import shutil
import sys
import time
from contextlib import contextmanager, suppress
from importlib import import_module
from typing import IO, TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path


UNFINISHED = ".unfinished"
PRIVATE_FILE, PRIVATE_FOLDER = 0o600, 0o700  # modes for the owner alone
_NO_LINKS = (errno.EPERM, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP)  # file systems without links, e.g. FAT

LOCKS_ARE_BYTES = os.name == "nt"

if sys.platform == "darwin":
    import fcntl

    def _sync(handle: int) -> None:
        """Sync a file; macOS' fsync leaves it in the cache of the drive."""
        try:
            fcntl.fcntl(handle, fcntl.F_FULLFSYNC)
        except OSError:  # not supported by the file system
            os.fsync(handle)

else:
    _sync = os.fsync


def _open_private(path: str, flags: int) -> int:
    return os.open(path, flags, PRIVATE_FILE)


class Disk:
    """The steps of a durable write, one call each, so that a test can make any of them fail."""

    def create(self, path: Path, *, private: bool = False) -> IO[bytes]:
        """Create a file, of mode 0600 if private, and open it for writing; `FileExistsError` when it exists."""
        return open(path, "xb", opener=_open_private if private else None)

    def write(self, file: IO[bytes], content: bytes) -> None:
        """Write the content to the operating system."""
        file.write(content)
        file.flush()

    def sync(self, file: IO[bytes]) -> None:
        """Return when the content of the file is on the disk."""
        _sync(file.fileno())

    def sync_again(self, path: Path) -> None:
        """Return when a file of another writer is on the disk."""
        with path.open("rb" if os.name == "posix" else "r+b") as file:
            self.sync(file)

    def reopen(self, path: Path) -> IO[bytes]:
        """Open an existing file for writing."""
        return path.open("r+b")

    def read_from(self, path: Path, start: int) -> bytes:
        """The content of a file from a position on."""
        with path.open("rb") as file:
            file.seek(start)
            return file.read()

    def rename(self, draft: Path, path: Path) -> None:
        """Move the draft to its path, replacing another file."""
        draft.replace(path)

    def name(self, draft: Path, path: Path) -> None:
        """Move the draft to a new path; `FileExistsError` when it is taken."""
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
        # A rename is durable only when the folder is synced; other systems have no such call.
        if os.name == "posix":
            handle = os.open(folder, os.O_RDONLY)
            try:
                _sync(handle)
            finally:
                os.close(handle)

    def make_folder(self, folder: Path, *, private: bool = False) -> None:
        """Create a folder unless it exists; a private one has mode 0700."""
        folder.mkdir(mode=PRIVATE_FOLDER if private else 0o777, exist_ok=True)

    def remove(self, path: Path) -> None:
        """Remove a file."""
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
    """Write a file durably; readers never see a part of it.

    The draft lies in the folder ``drafts`` on the same disk, by default that of the file. ``replace`` allows to replace
    an existing file; a ``private`` one can be read by the owner alone.

    Raises
    ------
    OSError
        When it cannot be written durably. No file remains, or the whole file where only the sync of the folder failed.
        `FileExistsError` when the name is taken.
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
    """Append to a file durably, after its first ``after`` bytes, by default after all.

    `OSError` when it cannot be written; the file is then as before. A power loss may leave a part of ``content``.
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
    """Create a folder and its missing parents durably, all private or none; OSError on failure.

    Existing folders are synced too: their creator may have been killed before the sync.
    """
    folder = folder.absolute()
    for parent in (*reversed(folder.parents), folder):
        created = not parent.is_dir()
        if created:
            disk.make_folder(parent, private=private)
        try:
            disk.sync_folder(parent.parent)
        except OSError:
            if created or parent == folder:  # other parents may refuse a sync
                raise


def remove_unfinished(folder: Path, *, age_s: float = 0.0) -> None:
    """Remove drafts of killed writers that are at least ``age_s`` old."""
    for draft in folder.glob(f".*{UNFINISHED}"):
        with suppress(OSError):
            if time.time() - draft.stat().st_mtime >= age_s:
                draft.unlink()


@contextmanager
def atomic_file(requested: Path, *, disk: Disk = DISK) -> Iterator[Path]:
    """A draft of the file ``requested``: durably renamed when the block succeeds, else removed.

    Raises OSError when it cannot be written, `FileExistsError` when the name is taken.
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
    """A draft of the folder ``requested``: durably renamed when the block succeeds, else removed.

    Raises OSError when it cannot be written, `FileExistsError` when the name is taken.
    """
    draft = _draft_of(requested, disk)
    draft.mkdir()  # with the mode of any new folder of the user
    try:
        yield draft
        for path in sorted(draft.rglob("*")):
            if path.is_dir():
                disk.sync_folder(path)
            else:
                disk.sync_again(path)
        disk.sync_folder(draft)
        _require_new(requested)  # a rename would replace an empty folder
        disk.rename(draft, requested)
    except BaseException:
        shutil.rmtree(draft, ignore_errors=True)
        raise
    disk.sync_folder(requested.parent)


def add_files(folder: Path, files: Mapping[str, bytes], *, disk: Disk = DISK) -> None:
    """Add all ``files`` (name -> bytes) to a folder, created where missing, or none of them.

    They are renamed when all are on the disk; only a power loss during the renaming can leave a part of them.
    Raises OSError when a file cannot be written, `FileExistsError` when a name is taken.
    """
    if not os.path.lexists(folder):
        with atomic_folder(folder, disk=disk) as draft:
            for name, content in files.items():
                (draft / name).write_bytes(content)
        return
    if not files:
        return
    named: list[Path] = []
    draft = _draft_of(folder / "files", disk)
    draft.mkdir()
    try:
        for name, content in files.items():
            write_durably(draft / name, content, disk=disk)
        for name in files:
            disk.name(draft / name, folder / name)
            named.append(folder / name)
        disk.sync_folder(folder)
    except BaseException:
        for path in named:
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
    if "\0" in str(requested):
        raise OSError(errno.EINVAL, os.strerror(errno.EINVAL), str(requested))
    if requested.name in ("", "..") or os.path.lexists(requested):
        raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(requested))


@contextmanager
def exclusive_lock(path: Path, *, wait: bool) -> Iterator[None]:
    """Lock an existing folder or file, which nothing replaces; the system ends the lock with the process.

    Windows locks no folders: there a byte of a file beside it is locked. Some network file systems have no locks:
    nothing is locked there.

    Raises
    ------
    BlockingIOError
        When another process has the lock and ``wait`` is false.
    OSError
        When the path cannot be opened.
    """
    if not LOCKS_ARE_BYTES:
        handle = os.open(path, os.O_RDONLY)
        try:
            _lock_whole(handle, wait=wait)
            yield
        finally:
            os.close(handle)  # which unlocks
        return
    path.stat()  # which raises where nothing is to be locked
    handle = os.open(path.with_name(f"{path.name}.lock"), os.O_RDWR | os.O_CREAT)
    try:
        with _locked_byte(handle, wait=wait):
            yield
    finally:
        os.close(handle)


def _lock_whole(handle: int, *, wait: bool) -> None:
    import fcntl

    try:
        fcntl.flock(handle, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise
    except OSError:  # no locks on this file system
        pass


@contextmanager
def _locked_byte(handle: int, *, wait: bool) -> Iterator[None]:
    windows: Any = import_module("msvcrt")
    while True:
        try:
            windows.locking(handle, windows.LK_LOCK if wait else windows.LK_NBLCK, 1)
            break
        except OSError as error:
            if not wait:
                raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN)) from error
            if error.errno != errno.EDEADLOCK:  # Windows gives up after ten seconds
                raise
    try:
        yield
    finally:
        windows.locking(handle, windows.LK_UNLCK, 1)
