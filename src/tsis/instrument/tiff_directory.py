"""The directories of a TIFF file, walked before any decoder sees it: what they list must fit, and be said once.

A directory of a few thousand entries may point them all at the same megabyte, and a decoder that loads them takes
gigabytes for it. Two widths in one directory let two decoders see different pictures.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

MOST_ENTRIES, MOST_DIRECTORIES, MOST_NUMBER_BYTES = 4096, 16, 4 * 2**20
SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 6: 1, 7: 1, 8: 2, 9: 4, 10: 8, 11: 4, 12: 8, 13: 4, 16: 8, 17: 8, 18: 8}
PLAIN_BYTES = frozenset({1, 2, 6, 7})
DECISIVE = frozenset({256, 257, 258, 259, 262, 266, 273, 277, 278, 279, 284, 317, 322, 323, 324, 325, 339})
WIDTH, HEIGHT, WHOLE_NUMBERS = 256, 257, frozenset({3, 4, 16})


@dataclass(frozen=True, slots=True)
class _Form:
    """How offsets are written: classic files in 4 bytes, large ones in 8."""

    order: str
    large: bool

    def number(self, data: bytes, place: int) -> int:
        """An offset or count."""
        return int(struct.unpack_from(self.order + ("Q" if self.large else "I"), data, place)[0])


def tiff_fault(data: bytes) -> str | None:
    """Walk the directories of a TIFF file; None when they may be given to a decoder."""
    order = "<" if data.startswith(b"II") else ">"
    try:
        form = _Form(order, large=struct.unpack_from(order + "H", data, 2)[0] == 43)
        place, seen = form.number(data, 8 if form.large else 4), 0
        while place:
            seen += 1
            if seen > MOST_DIRECTORIES:
                return f"it lists more than {MOST_DIRECTORIES} pictures"
            entries = struct.unpack_from(order + ("Q" if form.large else "H"), data, place)[0]
            if not 0 < entries <= MOST_ENTRIES:
                return f"a directory of it lists {entries} entries"
            if (broken := _directory_fault(list(_entries(data, place, entries, form)), len(data))) is not None:
                return broken
            place = form.number(data, place + (8 + 20 * entries if form.large else 2 + 12 * entries))
    except (struct.error, OverflowError):  # beyond the end, or beyond any place in a file
        return f"it is truncated: it ends at byte {len(data)} before a directory that it names"
    return None


def _entries(data: bytes, place: int, entries: int, form: _Form) -> Iterator[tuple[int, int, int]]:
    """Tag, kind and count of each entry."""
    first, step = (place + 8, 20) if form.large else (place + 2, 12)
    for number in range(entries):
        tag, kind = struct.unpack_from(form.order + "HH", data, first + step * number)
        yield tag, kind, form.number(data, first + step * number + 4)


def _directory_fault(entries: list[tuple[int, int, int]], size: int) -> str | None:
    decisive = [tag for tag, _, _ in entries if tag in DECISIVE]  # honest programs describe a picture twice
    if len(set(decisive)) < len(decisive):
        return "a directory of it says twice how large or of what kind its picture is"
    if any(tag in (WIDTH, HEIGHT) and (kind not in WHOLE_NUMBERS or count != 1) for tag, kind, count in entries):
        return "a directory of it does not state its width and height as one whole number each"
    texts = sum(count * SIZES.get(kind, 1) for _, kind, count in entries if kind in PLAIN_BYTES)
    numbers = sum(count * SIZES.get(kind, 1) for _, kind, count in entries if kind not in PLAIN_BYTES)
    if texts > size or numbers > min(size, MOST_NUMBER_BYTES):
        return f"a directory of it lists {texts + numbers} bytes"
    return None
