"""Sources of a bundle: a folder or a zip file, listed and read within bounds."""

from __future__ import annotations

import os
import stat
import zipfile
from contextlib import contextmanager
from typing import TYPE_CHECKING, Protocol

from tsis.errors import FileInputError
from tsis.files import as_path, file_error, file_size, printable_path
from tsis.records.export.bundle._layout import FOLDERS, MIB, MOST_FILES

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


MOST_UNPACKED, FREE_BYTES = 100, 16 * MIB  # limit of the unpacked size: ratio to the zip file, and allowance
END, END_64 = b"PK\x05\x06", b"PK\x06\x07"
DIRECTORY_BYTES = 256  # of an entry in the directory of a zip file, far above the need of valid names


class BundleSource(Protocol):
    """A bundle's files by their names."""

    def sizes(self) -> dict[str, int]:
        """Declared size of every file in bytes."""

    def read(self, name: str, most: int) -> bytes:
        """Content of a file of at most ``most`` bytes."""


def bundle_source(path: str | os.PathLike[str]) -> BundleSource:
    """The folder or zip file of this name, or `FileInputError`."""
    position = as_path(path)
    if position.is_dir():
        return FolderSource(position)
    return ZipSource(position, file_size(position))


class FolderSource:
    """A folder: regular files in it and in the folders of a bundle, no links."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def sizes(self) -> dict[str, int]:
        """Size of every file in bytes."""
        sizes: dict[str, int] = {}
        with _refusing(printable_path(self.folder)):
            self._list(self.folder, "", sizes)
        return sizes

    def _list(self, folder: Path, before: str, sizes: dict[str, int]) -> None:
        with os.scandir(folder) as entries:
            for entry in entries:
                name = f"{before}{entry.name}"
                status = entry.stat(follow_symlinks=False)
                if stat.S_ISDIR(status.st_mode) and name in FOLDERS:
                    self._list(folder / entry.name, f"{name}/", sizes)
                elif stat.S_ISREG(status.st_mode):
                    sizes[name] = status.st_size
                else:
                    raise FileInputError(f"{name!r:.120} must be a file of a bundle; got a link, folder or device")
                if len(sizes) > MOST_FILES:
                    raise file_error(self.folder, f"must hold at most {MOST_FILES} files; got more")

    def read(self, name: str, most: int) -> bytes:
        """Content of a file; links are not followed."""
        flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
        with _refusing(name), os.fdopen(os.open(self.folder / name, flags), "rb") as file:
            if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                raise FileInputError(f"{name} must be a regular file; got something else")
            return _bounded(file.read(most + 1), name, most)


class ZipSource:
    """A zip file: declared sizes are checked first, and again during unpacking."""

    def __init__(self, path: Path, size: int) -> None:
        self.path, self.size = path, size

    def sizes(self) -> dict[str, int]:
        """Size of every file in bytes, from the directory of the zip file."""
        with _refusing(printable_path(self.path)):
            self._require_short_directory()
            with zipfile.ZipFile(self.path) as file:
                entries = [item for item in file.infolist() if item.filename not in {f"{name}/" for name in FOLDERS}]
        results = {entry.filename: entry.file_size for entry in entries}
        if len(results) != len(entries):
            raise file_error(self.path, "must hold every name once; got one twice")
        if sum(results.values()) > FREE_BYTES + MOST_UNPACKED * self.size:
            raise file_error(self.path, f"must unpack to at most {MOST_UNPACKED} times its size; it declares more")
        for entry in entries:
            if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) or entry.flag_bits & 1:
                raise FileInputError(f"{entry.filename!r:.120} must be stored or deflated, not encrypted; it is not")
        return results

    def _require_short_directory(self) -> None:
        """Check the length of the directory, which takes memory before its entries can be checked."""
        with self.path.open("rb") as file:
            file.seek(max(0, self.size - 42))
            tail = file.read(42)
        if tail[-22:-18] != END or tail[-2:] != b"\0\0" or tail[:4] == END_64:
            raise file_error(self.path, "must be a zip file of at most 4 GiB without comment; it is not")
        if int.from_bytes(tail[-10:-6], "little") > MOST_FILES * DIRECTORY_BYTES:
            raise file_error(self.path, f"must hold at most {MOST_FILES} files; its directory is longer")

    def read(self, name: str, most: int) -> bytes:
        """Content of a file; unpacking stops after ``most`` bytes."""
        with _refusing(name), zipfile.ZipFile(self.path) as file, file.open(name) as entry:
            return _bounded(entry.read(most + 1), name, most)


def _bounded(content: bytes, name: str, most: int) -> bytes:
    if len(content) > most:
        raise FileInputError(f"{name} must hold at most {most} bytes; got more")
    return content


@contextmanager
def _refusing(what: str) -> Iterator[None]:
    try:
        yield
    except FileInputError:
        raise
    except Exception as error:  # on hostile bytes the parsers raise nearly anything
        reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
        raise FileInputError(f"{what} must be readable; got: {reason:.200}") from error
