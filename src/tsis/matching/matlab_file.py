"""Numbers, cells and structures of a MATLAB file (version 5), whatever its bytes.

SciPy's reader of such files, which is compiled, ends the process on some that are damaged. This one reads what the
public sequences hold, checks that everything declared lies inside the file, and unpacks no more than it may.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from math import prod
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from tsis.model.errors import FileInputError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

Value: TypeAlias = "NDArray[np.float64] | list[Any] | None"

HEADER_BYTES, TAG_BYTES = 128, 8
MATRIX, COMPRESSED = 14, 15
CELL, STRUCTURE, NUMERIC = 1, 2, range(6, 16)
NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
DEEPEST = 16


def read_matrices(content: bytes, *, most: int) -> dict[str, Value]:
    """What a file holds, by name.

    Parameters
    ----------
    content
        The whole file.
    most
        Bytes that it may unpack to.

    Returns
    -------
    Numbers as arrays of their shape; cells as lists, the first axis fastest; structures as lists of mappings by field.
    None for anything else, e.g. text.

    Raises
    ------
    FileInputError
        When it is no such file, damaged, or declares more than it holds; the sentence does not name the file.
    """
    order = {b"IM": "<", b"MI": ">"}.get(content[126:128])
    if order is None:
        raise FileInputError("it must be a MATLAB file of version 5; it begins otherwise")
    found: dict[str, Value] = {}
    try:
        for kind, data in _elements(content[HEADER_BYTES:], order):
            if kind == COMPRESSED:
                most -= len(inner := _unpacked(data, most))
                found |= dict(_matrix(each, order, 0) for kind, each in _elements(inner, order) if kind == MATRIX)
            elif kind == MATRIX:
                found |= [_matrix(data, order, 0)]
    except (struct.error, zlib.error, ValueError) as error:
        if isinstance(error, FileInputError):
            raise
        raise FileInputError("it must be a whole MATLAB file; it is damaged") from error
    return found


def _elements(held: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    """Kind and data of one element after the other."""
    place = 0
    while place < len(held):
        kind, size = struct.unpack_from(order + "II", held, place)
        start = place + TAG_BYTES
        if kind >> 16:  # a small element: size and kind share a word, and the data follows at once
            kind, size, start = kind & 0xFFFF, kind >> 16, place + 4
            if size > 4:
                raise FileInputError("a small element must hold at most 4 bytes; it says more")
        stop = start + size
        if stop > len(held):
            raise FileInputError("its elements must lie inside it; it is cut short")
        yield kind, held[start:stop]
        place = stop if kind == COMPRESSED else place + -(-(stop - place) // 8) * 8  # only these are not padded


@dataclass(frozen=True, slots=True)
class _Head:
    """What a matrix says of itself: class, shape and name."""

    kind: int
    shape: tuple[int, ...]
    name: str


def _matrix(data: bytes, order: str, depth: int) -> tuple[str, Value]:
    if not data:
        return "", np.zeros((0, 0))
    if depth > DEEPEST:
        raise FileInputError(f"its matrices must not lie deeper than {DEEPEST}; they do")
    parts = _elements(data, order)
    head = _head(parts, order, len(data))
    if head.kind == CELL:
        return head.name, [_inner(parts, order, depth) for _ in range(prod(head.shape))]
    if head.kind == STRUCTURE:
        (_, length), (_, names) = _next(parts), _next(parts)
        (width,) = struct.unpack(order + "i", length)
        if not 0 < width <= len(names):
            return head.name, []
        fields = [_text(names[at : at + width]) for at in range(0, len(names), width)]
        return head.name, [{field: _inner(parts, order, depth) for field in fields} for _ in range(prod(head.shape))]
    if head.kind not in NUMERIC:
        return head.name, None
    kind, numbers = _next(parts)
    flat = np.frombuffer(numbers, dtype=order + NUMBERS[kind] if kind in NUMBERS else "V0")
    if flat.size != prod(head.shape):
        raise FileInputError(f"a matrix of shape {head.shape!s:.60} must hold as many numbers; got {flat.size}")
    return head.name, flat.astype(float).reshape(head.shape, order="F")


def _head(parts: Iterator[tuple[int, bytes]], order: str, room: int) -> _Head:
    (_, flags), (_, sides) = _next(parts), _next(parts)
    shape = struct.unpack(f"{order}{len(sides) // 4}i", sides)
    # every cell takes the eight bytes of a tag, every number one
    if not 2 <= len(shape) <= 8 or min(shape) < 0 or prod(shape) > room:
        raise FileInputError(f"its matrices must fit into it; one of {shape!s:.60} does not")
    return _Head(struct.unpack_from(order + "I", flags)[0] & 0xFF, shape, _text(_next(parts)[1]))


def _next(parts: Iterator[tuple[int, bytes]]) -> tuple[int, bytes]:
    part = next(parts, None)
    if part is None:
        raise FileInputError("a matrix must hold all that it declares; something is missing")
    return part


def _inner(parts: Iterator[tuple[int, bytes]], order: str, depth: int) -> Value:
    kind, data = _next(parts)
    if kind != MATRIX:
        raise FileInputError("a cell must hold a matrix; it holds something else")
    return _matrix(data, order, depth + 1)[1]


def _text(name: bytes) -> str:
    return name.split(b"\0")[0].decode("latin-1")


def _unpacked(packed: bytes, most: int) -> bytes:
    unpacker = zlib.decompressobj()
    found = unpacker.decompress(packed, most + 1)
    if len(found) > most:
        raise FileInputError(f"it must unpack to at most {most} bytes; it unpacks to more")
    if not unpacker.eof:
        raise FileInputError("it must be a whole MATLAB file; it is cut short")
    return found


__all__ = ["read_matrices"]
