"""Reading files that a user named, with bounded size and clear errors."""

from __future__ import annotations

import io
import json
import stat
import tomllib
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from tsis.errors import FileInputError, InputError, TsisError

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Iterator


Parsed = TypeVar("Parsed")

LARGEST_FILE_BYTES = 512 * 2**20
LARGEST_OBJECT_BYTES = 8 * 2**20
MOST_VALUES, DEEPEST = 200_000, 64
_LARGEST_UTF8_BYTES = 8 * 2**20  # a larger file must be ASCII, as tsis writes it: else a letter may take 4 bytes
_LONGEST_SHOWN = 120
LONGEST_FILE_NAME = 255  # bytes, as file systems allow


def printable_path(path: Path) -> str:
    """A path as messages print it: quoted, control characters escaped, long ones cut at the front.

    Examples
    --------
    >>> printable_path(Path("frame.png"))
    "'frame.png'"
    """
    text = str(path)
    return repr(text if len(text) <= _LONGEST_SHOWN else "..." + text[-_LONGEST_SHOWN:])


def file_error(path: Path, requirement: str, kind: type[TsisError] = FileInputError) -> TsisError:
    """The error on a file or folder, whose printable path begins the message, e.g. ``"must be a file"``."""
    return kind(f"{printable_path(path)} {requirement}")


def own_file(folder: Path, name: str) -> Path:
    """The file of this name in a folder; `FileInputError` for names that lead elsewhere, and for links."""
    path = folder / name
    if not _is_safe_name(name) or name in ("", ".", ".."):
        raise file_error(folder, f"must name files of its own; it names {name!r:.80}")
    if path.is_symlink():
        raise file_error(path, "must be a file of its own; it is a link that leads elsewhere")
    return path


def _is_safe_name(name: str) -> bool:
    return name.isprintable() and len(name.encode()) <= LONGEST_FILE_NAME and not any(mark in name for mark in "/\\")


@contextmanager
def written_by(command: str, path: Path) -> Iterator[None]:
    """Convert errors of the values in a file that a command writes to `FileInputError`."""
    try:
        yield
    except FileInputError:
        raise
    except (ValueError, KeyError, TypeError, AttributeError) as error:  # InputError is a ValueError
        fault = f"it holds no {error}" if isinstance(error, KeyError) else str(error)
        raise file_error(path, f"must be as {command} wrote it; {fault}") from error


def printable_name(path: Path) -> str:
    r"""A file's name as reports print it, with ``?`` for unprintable characters.

    Examples
    --------
    >>> printable_name(Path("a\x1b[2Jb.png"))
    'a?[2Jb.png'
    """
    return "".join(letter if letter.isprintable() else "?" for letter in path.name)


def one_line(error: object, longest: int = 200) -> str:
    r"""The text of an error as a part of a message: one printable line of limited length.

    Examples
    --------
    >>> one_line(ValueError("bad header:\n\tmagic \x1b[2J"))
    'bad header: magic ?[2J'
    """
    text = " ".join(str(error)[: 10 * longest].split()) or type(error).__name__
    return "".join(letter if letter.isprintable() else "?" for letter in text)[:longest]


def as_path(path: str | os.PathLike[str]) -> Path:
    """Return ``path`` as a Path, or raise `InputError`."""
    try:
        return Path(path)
    except TypeError as error:
        raise InputError(f"path must be the name of a file; got {path!r:.80}") from error


def file_size(path: Path) -> int:
    """Size in bytes of a regular, non-empty file.

    Pipes, terminals and devices are refused before they are opened: reading one may never end.

    Raises
    ------
    FileInputError
        When the file is missing, unreadable, not regular, or empty.
    """
    try:
        status = path.stat()
    except FileNotFoundError as error:
        raise file_error(path, "does not exist; check the name and the folder") from error
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise file_error(path, f"must name a readable file; got: {reason}") from error
    if stat.S_ISDIR(status.st_mode):
        raise file_error(path, "must be a file; got a folder")
    if not stat.S_ISREG(status.st_mode):
        raise file_error(path, "must be a regular file; got a device, pipe or socket")
    if status.st_size == 0:
        raise file_error(path, "must hold data; got an empty file (0 bytes)")
    return status.st_size


def read_bytes(path: Path, *, most: int = LARGEST_FILE_BYTES) -> bytes:
    """Read a whole regular file of at most ``most`` bytes, by default 512 MiB.

    Raises
    ------
    FileInputError
        As `file_size`, and when the file is too large or unreadable.
    """
    size = file_size(path)
    if size > most:
        raise file_error(path, f"must be at most {most} bytes; got {size}")
    return _first_bytes(path, most)  # bounded: the file may have grown since its size was read


def read_parsed(path: Path, parse: Callable[[str], Parsed], *, most: int = LARGEST_FILE_BYTES) -> Parsed:
    """The result of ``parse`` for the text of a file.

    Raises
    ------
    FileInputError
        As `read_bytes`, when the file is no UTF-8 text, and for `InputError` of ``parse``, with the name of the file.
    """
    data = read_bytes(path, most=most)
    try:
        return parse(data.decode())
    except InputError as error:
        raise FileInputError(f"{printable_path(path)}: {error}") from error
    except UnicodeDecodeError as error:
        raise file_error(path, "must be text in UTF-8; it is not") from error


LONGEST_KEY = 16  # parts


def parse_toml(text: str, *, what: str) -> dict[str, Any]:
    """The values of a TOML text; ``what`` names it in errors.

    Raises
    ------
    InputError
        When the text is no TOML, or a key has more than 16 parts.

    Examples
    --------
    >>> parse_toml("presence = 0.1", what="a prior")
    {'presence': 0.1}
    """
    _require_short_keys(text, what)
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # a number of 5000 digits is no error of TOML's
        raise InputError(f"{what} must be TOML; got: {one_line(error)}") from error


def _require_short_keys(text: str, what: str) -> None:
    """Refuse long dotted keys, whose parsing time is quadratic."""
    run = 0
    for part in text.split("."):
        run = 0 if any(mark in part for mark in "\n=,[]") else run + 1
        if run > LONGEST_KEY:
            raise InputError(f"{what} must be TOML with keys of at most {LONGEST_KEY} parts; got a longer one")


def read_head(path: Path, length: int = 64) -> bytes:
    """The first bytes of a regular file, which tell its format; errors as `read_bytes`."""
    file_size(path)
    return _first_bytes(path, length)


def _first_bytes(path: Path, most: int) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(most)
    except OSError as error:
        raise file_error(path, f"must be readable; got: {error.strerror}") from error


def read_object(path: Path, *, most: int = LARGEST_OBJECT_BYTES, values: int = MOST_VALUES) -> dict[str, Any]:
    """Read a JSON file with an object of at most ``most`` bytes and ``values`` values; errors as `read_bytes`.

    The values are counted before parsing: a byte of JSON can take a hundred bytes of memory.
    """
    if not _begins_as_json(read_head(path)):
        raise file_error(path, "must be a readable JSON file; got something that begins otherwise")
    return parse_object(read_bytes(path, most=most), printable_path(path), values=values)


def parse_object(data: bytes, name: str, *, values: int = MOST_VALUES) -> dict[str, Any]:
    """The object in the content of a JSON file, or `FileInputError`, which calls the file ``name``."""
    if not _begins_as_json(data[:64]):
        raise FileInputError(f"{name} must be a readable JSON file; got something that begins otherwise")
    if sum(map(data.count, (b"[", b"{", b","))) > values:
        raise FileInputError(f"{name} must hold at most {values} values; it has more brackets and commas")
    if len(data) > _LARGEST_UTF8_BYTES and not data.isascii():
        raise FileInputError(f"{name} must be ASCII where it is larger than {_LARGEST_UTF8_BYTES} bytes; it is not")
    try:
        content = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise FileInputError(f"{name} must be a readable JSON file; got: {one_line(error)}") from error
    if not isinstance(content, dict):
        raise FileInputError(f"{name} must hold a JSON object; got {type(content).__name__}")
    if data.count(b"[") + data.count(b"{") > DEEPEST and _depth(content) > DEEPEST:
        raise FileInputError(f"{name} must be nested at most {DEEPEST} deep; it is deeper")
    return content


def _begins_as_json(head: bytes) -> bool:
    return head.lstrip(b"\xef\xbb\xbf \t\r\n").startswith((b"{", b"["))


def _depth(content: Any) -> int:
    """Nesting depth of lists and objects, without recursion."""
    depth, level = 0, [content]
    while level:
        depth += 1
        inner = (item.values() if isinstance(item, dict) else item for item in level)
        level = [item for stored in inner for item in stored if isinstance(item, (dict, list))]
    return depth


LONGEST_LINE = 65_536
_FEW = 10_000  # lines that may be empty or comments


def text_lines(content: bytes, *, most: int) -> Iterator[tuple[int, str]]:
    r"""Number, from 1, and text of each UTF-8 line, without its end.

    Parameters
    ----------
    content
        The whole file, with line ends of any system.
    most
        Largest number of lines; ten thousand more may be empty.

    Raises
    ------
    FileInputError
        When it is no such text, has more lines or one that is longer than 65536 bytes; the message does not name the
        file.

    Examples
    --------
    >>> list(text_lines(b"\xef\xbb\xbfx,y\r\n1,2", most=10))
    [(1, 'x,y'), (2, '1,2')]
    """
    ends = content.count(b"\n")
    if not ends:
        content = content.replace(b"\r", b"\n")
        ends = content.count(b"\n")
    if ends > most + _FEW:
        raise FileInputError(f"it must have at most {most} lines; got {ends}")
    stream, number = io.BytesIO(content), 0
    while line := stream.readline(LONGEST_LINE + 1):
        number += 1
        if len(line) > LONGEST_LINE:
            raise FileInputError(f"line {number} must be at most {LONGEST_LINE} bytes long; it is longer")
        try:
            yield number, line.decode("utf-8-sig" if number == 1 else "utf-8").rstrip("\r\n")
        except UnicodeDecodeError as error:
            raise FileInputError(f"line {number} must be text in UTF-8; it holds other bytes") from error
