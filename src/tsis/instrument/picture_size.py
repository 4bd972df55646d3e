"""What a picture may declare, given how many bytes it has: checked before memory is taken for its pixels.

Up to 16 million pixels a file may be as small as it likes, since an even frame packs a thousandfold. Beyond, up to the
levels of any frame that is written here, it must hold what its format takes at least for so many pixels: a dark frame
packs as far as that and is honest. Only more levels than that must take a byte for every 24 pixels, a third of what
strongly compressed JPEG takes; so must formats whose pixels cannot be counted before they are decoded. A PNG is
unpacked once in small pieces before it is unpacked for good, so that one whose pixels are missing never takes their
memory, and is never filled up.
"""

from __future__ import annotations

import struct
import zlib

LARGEST_PIXELS = 65_000_000  # sensors sold as 64 million have 64.1 to 64.5
FREE_PIXELS, PIXELS_A_BYTE = 16_000_000, 24
FREE_BYTES = 3 * LARGEST_PIXELS  # of levels: colour of 8 bits, or grey of 16
MOST_PIXELS_A_BYTE = {"PNG": 1032, "JPEG": 512}  # deflate packs no further; a block of 64 pixels takes a bit
_PIECE = 4096  # packed bytes, of which none becomes more than 1032
# first column and step, first row and step of each pass
_WHOLE = ((0, 1, 0, 1),)
_ADAM7 = ((0, 8, 0, 8), (4, 8, 0, 8), (0, 4, 4, 8), (2, 4, 0, 4), (0, 2, 2, 4), (1, 2, 0, 2), (0, 1, 1, 2))
_CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}


def size_fault(columns: int, rows: int, file_bytes: int, *, kind: str, pixel_bytes: int) -> str | None:
    """Why no picture of this size may be decoded from a file of so many bytes; None when it may.

    Parameters
    ----------
    columns, rows
        What the file declares.
    file_bytes
        How many bytes it has.
    kind
        Its format, e.g. ``"PNG"``.
    pixel_bytes
        What the levels of a pixel take, all channels together.

    Examples
    --------
    >>> size_fault(8000, 8000, 64_000, kind="PNG", pixel_bytes=2)
    >>> size_fault(8000, 8000, 64_000, kind="PNG", pixel_bytes=8)
    'a byte for every 24 pixels beyond 16000000 pixels; it declares 8000 x 8000 in 64000 bytes'
    """
    pixels = columns * rows
    if pixels > LARGEST_PIXELS:
        return f"at most {LARGEST_PIXELS} pixels; it declares {columns} x {rows}"
    most = MOST_PIXELS_A_BYTE.get(kind, PIXELS_A_BYTE) if pixels * pixel_bytes <= FREE_BYTES else PIXELS_A_BYTE
    if pixels > FREE_PIXELS and pixels > most * file_bytes:
        return (
            f"a byte for every {most} pixels beyond {FREE_PIXELS} pixels; "
            f"it declares {columns} x {rows} in {file_bytes} bytes"
        )
    return None


def rows_missing(data: bytes) -> bool:
    """Whether the pixels of a PNG file, already found whole, are fewer than its header declares.

    Pillow fills what is missing with zeros and says nothing.
    """
    if not data.startswith(b"\x89PNG"):
        return False
    columns, rows, depth, colour = struct.unpack_from(">IIBB", data, 16)
    bits, interlaced = _CHANNELS.get(colour, 1) * depth, data[28] == 1
    wanted = sum(
        high * (1 + -(-wide * bits // 8))
        for left, across, top, down in (_ADAM7 if interlaced else _WHOLE)
        if (wide := -(-(columns - left) // across)) > 0 and (high := -(-(rows - top) // down)) > 0
    )
    unpacker, place, kind, found = zlib.decompressobj(), 8, b"", 0
    view = memoryview(data)
    try:
        while kind != b"IEND" and found < wanted:
            (length,) = struct.unpack_from(">I", data, place)
            kind, end = data[place + 4 : place + 8], place + 8 + length
            for start in range(place + 8, end, _PIECE) if kind == b"IDAT" else ():
                found += len(unpacker.decompress(view[start : min(start + _PIECE, end)]))
                if unpacker.eof or found >= wanted:
                    return bool(found < wanted)
            place += 12 + length
    except zlib.error:
        return True
    return bool(found < wanted)
