"""Arrays from NumPy files of untrusted content: the declared sizes are checked before anything is unpacked."""

from __future__ import annotations

import ast
import io
import math
import re
import zipfile
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import FileInputError

if TYPE_CHECKING:
    from collections.abc import Collection

    from numpy.typing import NDArray


LARGEST_UNPACKED_BYTES = 512 * 2**20
MOST_MEMBERS = 10_000
LONGEST_HEADER, MOST_AXES = 10_000, 32
_ENDING = ".npy"
_NUMBERS = re.compile(r"[<>|=]?(b1|[iu][1248]|f[248]|U[0-9]{1,4})")


def read_arrays(
    content: bytes, names: Collection[str] | None = None, *, most: int = LARGEST_UNPACKED_BYTES
) -> dict[str, NDArray[Any]]:
    """Arrays of an archive by name; objects are never unpickled.

    Parameters
    ----------
    content
        The whole archive.
    names
        Arrays to read; missing names are skipped. None for all.
    most
        Largest total size of these arrays in bytes.

    Raises
    ------
    FileInputError
        When it is no such archive, is damaged, or declares more; the message does not name the file.

    Examples
    --------
    >>> stream = io.BytesIO()
    >>> np.savez(stream, allow_pickle=False, depth=np.arange(3.0))
    >>> read_arrays(stream.getvalue())
    {'depth': array([0., 1., 2.])}
    """
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = archive.infolist()
            chosen = {
                member.filename.removesuffix(_ENDING): member
                for member in members
                if member.filename.endswith(_ENDING) and (names is None or member.filename[: -len(_ENDING)] in names)
            }
            _require_small(members, sum(member.file_size for member in chosen.values()), most)
            return {name: _array(_member_bytes(archive, member)) for name, member in chosen.items()}
    except FileInputError:
        raise
    except Exception as error:  # on hostile bytes the parsers raise nearly anything
        raise FileInputError("it must be a whole archive of NumPy arrays; it is damaged or something else") from error


def _require_small(members: list[zipfile.ZipInfo], declared: int, most: int) -> None:
    if len(members) > MOST_MEMBERS:
        raise FileInputError(f"an archive must hold at most {MOST_MEMBERS} arrays; got {len(members)}")
    if declared > most:
        raise FileInputError(f"its arrays must take at most {most} bytes; it declares {declared}")


def _member_bytes(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> bytes:
    with archive.open(member) as stream:
        stored = stream.read(member.file_size + 1)  # the declared size may be false
    if len(stored) != member.file_size:
        raise FileInputError(f"an array must take the {member.file_size} bytes that it declares; it takes others")
    return stored


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """Header of a ``.npy`` file: shape, type, Fortran order, and the offset of the numbers in bytes."""

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    by_column: bool
    start: int

    def values(self, content: bytes) -> NDArray[Any]:
        """The array as a view of the content, whose size the caller has checked."""
        flat = np.frombuffer(content, dtype=self.dtype, offset=self.start)
        return flat.reshape(self.shape, order="F" if self.by_column else "C")


def npy_layout(content: bytes) -> Layout:
    """Read the header of a ``.npy`` file.

    NumPy's own reader accepts more than NumPy writes, and prints warnings.

    Raises
    ------
    FileInputError
        When the header is invalid, or of objects or records.
    """
    try:
        width = 2 if content[6] == 1 else 4
        start = 8 + width + int.from_bytes(content[8 : 8 + width], "little")
        text = content[8 + width : start] if start <= min(len(content), LONGEST_HEADER) else b""
        header = ast.literal_eval(text.decode("latin-1").strip())
        kind, by_column, shape = header["descr"], header["fortran_order"], header["shape"]
        sides = isinstance(shape, tuple) and all(type(side) is int and abs(side) < 2**48 for side in shape)
        sound = sides and len(header) == 3 and type(by_column) is bool and len(shape) <= MOST_AXES
    except (ValueError, KeyError, IndexError, TypeError, SyntaxError, MemoryError, RecursionError) as error:
        raise FileInputError("its NPY header must be whole; it is damaged") from error
    if not sound or content[:6] != b"\x93NUMPY":
        raise FileInputError("its NPY header must be one that NumPy writes; it is another")
    if not isinstance(kind, str) or not _NUMBERS.fullmatch(kind):
        remark = " (objects are never unpickled)" if kind == "|O" else ""
        raise FileInputError(f"the array must hold real numbers; got {kind!r:.40}{remark}")
    return Layout(shape=shape, dtype=np.dtype(kind), by_column=by_column, start=start)


def _array(content: bytes) -> NDArray[Any]:
    layout = npy_layout(content)
    if math.prod(layout.shape) * layout.dtype.itemsize != len(content) - layout.start:
        raise FileInputError(f"an array of shape {layout.shape!s:.60} must be whole; it is cut short")
    return layout.values(content).copy(order="K")
