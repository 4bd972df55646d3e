"""Vertices of PLY files, text and binary."""

from __future__ import annotations

import io
import itertools
from array import array
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.model.errors import FileInputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

LONGEST_HEADER = 65_536
FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Vertices:
    """What a header says of the vertices.

    Attributes
    ----------
    order
        Byte order as NumPy writes it; empty for text.
    count
        How many there are said to be.
    types
        NumPy's type of each property, by name, in order.
    """

    order: str
    count: int
    types: dict[str, str]


def parse_ply(content: bytes, *, most: int) -> NDArray[np.float64]:
    r"""Coordinates of the vertices, shape (n, 2) or (n, 3).

    Parameters
    ----------
    content
        The whole file.
    most
        The largest number of vertices that is decoded.

    Raises
    ------
    FileInputError
        When the header or the data are broken, or the vertices are not the first element or too many.

    Examples
    --------
    >>> header = b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nend_header\n"
    >>> parse_ply(header + b"1.5 2\n", most=10).tolist()
    [[1.5, 2.0]]
    """
    head, mark, body = content[:LONGEST_HEADER].partition(b"end_header")
    if not mark:
        raise FileInputError(f"the PLY header must end within {LONGEST_HEADER} bytes; got none that does")
    start = len(head) + len(mark)
    start += 2 if body[:2] == b"\r\n" else 1
    vertices = _vertices(head.decode("ascii", errors="replace").splitlines())
    axes = [axis for axis in ("x", "y", "z") if axis in vertices.types]
    if axes[:2] != ["x", "y"]:
        raise FileInputError(f"PLY vertices must have x and y; got {', '.join(vertices.types)[:80]!r}")
    if not 0 < vertices.count <= most:
        raise FileInputError(f"it must hold 1 to {most} points; got {vertices.count} (thin them out)")
    return _text(content[start:], vertices, axes) if not vertices.order else _binary(content[start:], vertices, axes)


def _vertices(lines: list[str]) -> Vertices:
    order, count, types, element = None, None, {}, 0
    for line in lines[1:]:
        words = line.split()
        try:
            if words[:1] == ["format"]:
                order = FORMATS[words[1]]
            elif words[:1] == ["element"]:
                element += 1
                if element == 1 and words[1] == "vertex":
                    count = int(words[2])
            elif words[:1] == ["property"] and element == 1:
                if words[2] in types:
                    raise FileInputError(f"PLY vertices must have each property once; got {words[2]!r:.40} twice")
                types[words[2]] = TYPES[words[1]]
        except (KeyError, IndexError, ValueError) as error:
            if isinstance(error, FileInputError):
                raise
            raise FileInputError(f"a PLY header line must be one that is known; got {line.strip()!r:.60}") from error
    if order is None or count is None:
        raise FileInputError("a PLY header must give a format, and vertices as the first element")
    return Vertices(order=order, count=count, types=types)


def _text(body: bytes, vertices: Vertices, axes: Sequence[str]) -> NDArray[np.float64]:
    places = [list(vertices.types).index(axis) for axis in axes]
    points = array("d")
    for number, row in enumerate(itertools.islice(io.BytesIO(body), vertices.count)):
        cells = row.split()
        try:
            points.extend([float(cells[place]) for place in places])
        except (IndexError, ValueError) as error:
            text = row.decode("ascii", errors="replace").strip()
            raise FileInputError(f"vertex {number} must hold numbers for each property; got {text!r:.60}") from error
    found = len(points) // len(axes)
    if found < vertices.count:
        raise FileInputError(f"it must hold the {vertices.count} vertices of its header; got {found}")
    return np.array(points).reshape(-1, len(axes))


def _binary(body: bytes, vertices: Vertices, axes: Sequence[str]) -> NDArray[np.float64]:
    layout = np.dtype([(name, vertices.order + kind) for name, kind in vertices.types.items()])
    needed = vertices.count * layout.itemsize
    if len(body) < needed:
        raise FileInputError(f"the {vertices.count} vertices of its header take {needed} bytes; got {len(body)}")
    rows = np.frombuffer(body, dtype=layout, count=vertices.count)
    return np.column_stack([rows[axis].astype(float) for axis in axes])


__all__ = ["parse_ply"]
