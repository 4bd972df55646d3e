"""Whether a MATLAB file (version 5) may be read: what its matrices declare must lie inside it, however it is packed."""

from __future__ import annotations

import struct
import zlib
from math import prod

from tsis.model.errors import FileInputError

HEADER_BYTES, TAG_BYTES = 128, 8
MATRIX, COMPRESSED = 14, 15
DEEPEST, MOST_ELEMENTS = 32, 100_000


def require_small_inside(content: bytes, *, most: int) -> None:
    """Refuse a file that unpacks to more than ``most`` bytes, or declares a matrix larger than what it holds.

    Raises
    ------
    FileInputError
        When it does, or is cut short or no such file.
    """
    order = {b"IM": "<", b"MI": ">"}.get(content[126:128])
    if order is None or content[:1] == b"\0":
        raise FileInputError("it must be a MATLAB file of version 5; it begins otherwise")
    left, elements = [(content, HEADER_BYTES, len(content), 0)], 0
    try:
        while left:
            held, place, end, depth = left.pop()
            if depth > DEEPEST:
                raise FileInputError(f"its matrices must not lie deeper than {DEEPEST}; they do")
            number = 0
            while place + TAG_BYTES <= end:
                kind, start, stop = _element(held, place, order)
                if stop > end:
                    raise FileInputError("its elements must lie inside it; it is cut short")
                if depth > 0 and number == 1:  # the second element of a matrix holds its dimensions
                    _require_dimensions(held[start:stop], order, end - place)
                if kind == COMPRESSED:
                    inner = _unpacked(held[start:stop], most)
                    left.append((inner, 0, len(inner), depth))
                elif kind == MATRIX:
                    left.append((held, start, stop, depth + 1))
                number, elements = number + 1, elements + 1
                place = stop if kind == COMPRESSED else place + -(-(stop - place) // 8) * 8  # only these are not padded
            if elements > MOST_ELEMENTS:
                raise FileInputError(f"it must hold at most {MOST_ELEMENTS} elements; it holds more")
    except (struct.error, zlib.error) as error:
        raise FileInputError("it must be a whole MATLAB file; it is damaged") from error


def _element(held: bytes, place: int, order: str) -> tuple[int, int, int]:
    """Kind of an element, and where its data begins and ends."""
    kind, size = struct.unpack_from(order + "II", held, place)
    if kind >> 16:  # a small element: size and kind share a word, and the data follows at once
        return kind & 0xFFFF, place + 4, place + 4 + min(kind >> 16, 4)
    return kind, place + TAG_BYTES, place + TAG_BYTES + size


def _require_dimensions(data: bytes, order: str, room: int) -> None:
    sides = struct.unpack(f"{order}{len(data) // 4}i", data[: len(data) // 4 * 4])
    if any(side < 0 for side in sides) or prod(sides) > room:
        raise FileInputError(f"its matrices must fit into it; one of {sides!s:.60} does not")


def _unpacked(packed: bytes, most: int) -> bytes:
    unpacker = zlib.decompressobj()
    found = unpacker.decompress(packed, most + 1)
    if len(found) > most:
        raise FileInputError(f"it must unpack to at most {most} bytes; it unpacks to more")
    return found
