"""The bytes of a file that a user named, or one sentence that says why there are none."""

from __future__ import annotations

import json
import stat
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tsis.model.errors import FileInputError, InputError

if TYPE_CHECKING:
    import os

LARGEST_FILE_BYTES = 512 * 2**20
_LONGEST_SHOWN = 120


def shown(path: Path) -> str:
    """A path as messages print it: quoted, control characters escaped, long ones cut at the front.

    Examples
    --------
    >>> shown(Path("frame.png"))
    "'frame.png'"
    """
    text = str(path)
    return repr(text if len(text) <= _LONGEST_SHOWN else "..." + text[-_LONGEST_SHOWN:])


def printable_name(path: Path) -> str:
    r"""A file's name as reports print it: what no terminal or page should be given becomes a question mark.

    Examples
    --------
    >>> printable_name(Path("a\x1b[2Jb.png"))
    'a?[2Jb.png'
    """
    return "".join(letter if letter.isprintable() else "?" for letter in path.name)


def as_path(path: str | os.PathLike[str]) -> Path:
    """Return ``path`` as a Path, refusing anything that does not name a file."""
    try:
        return Path(path)
    except TypeError as error:
        raise InputError(f"path must be the name of a file; got {path!r:.80}") from error


def file_size(path: Path) -> int:
    """Size in bytes of a regular, non-empty file.

    Pipes, terminals and devices are refused by their kind, before anything opens them: reading one may never end.

    Raises
    ------
    FileInputError
        When there is no such file, it may not be read, it is no regular file, or it is empty.
    """
    try:
        status = path.stat()
    except FileNotFoundError as error:
        raise FileInputError(f"{shown(path)} does not exist; check the name and the folder") from error
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise FileInputError(f"{shown(path)} must name a readable file; got: {reason}") from error
    if stat.S_ISDIR(status.st_mode):
        raise FileInputError(f"{shown(path)} must be a file; got a folder")
    if not stat.S_ISREG(status.st_mode):
        raise FileInputError(f"{shown(path)} must be a regular file; got a device, pipe or socket")
    if status.st_size == 0:
        raise FileInputError(f"{shown(path)} must hold data; got an empty file (0 bytes)")
    return status.st_size


def read_bytes(path: Path) -> bytes:
    """Read a whole regular file of at most 512 MiB.

    Raises
    ------
    FileInputError
        As `file_size`, and when the file is larger than the cap or cannot be read.
    """
    size = file_size(path)
    if size > LARGEST_FILE_BYTES:
        raise FileInputError(f"{shown(path)} must be at most {LARGEST_FILE_BYTES} bytes; got {size}")
    try:
        with path.open("rb") as file:
            return file.read(LARGEST_FILE_BYTES)  # bounded: the file may have grown since its size was read
    except OSError as error:
        raise FileInputError(f"{shown(path)} must be readable; got: {error.strerror}") from error


def read_object(path: Path) -> dict[str, Any]:
    """Read a JSON file that holds one object.

    Raises
    ------
    FileInputError
        As `read_bytes`, and when it holds something else.
    """
    data = read_bytes(path)
    try:
        content = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise FileInputError(f"{shown(path)} must be a readable JSON file; got: {error}") from error
    if not isinstance(content, dict):
        raise FileInputError(f"{shown(path)} must hold a JSON object; got {type(content).__name__}")
    return content
