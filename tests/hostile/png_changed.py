"""PNG files whose chunks were changed and whose checksums are right again, as a forger would write them."""

from __future__ import annotations

import struct
import zlib
from typing import TYPE_CHECKING

from tests.hostile.bytes_changed import EXTREMES, damaged

if TYPE_CHECKING:
    import numpy as np

SIGNATURE = b"\x89PNG\r\n\x1a\n"
FURTHER = (
    (b"tEXt", b"Comment\0x"),
    (b"zTXt", b"Comment\0\0" + zlib.compress(bytes(3_000_000), 9)),
    (b"iTXt", b"Comment\0\1\0\0\0" + zlib.compress(bytes(3_000_000), 9)),
    (b"iCCP", b"icc\0\0" + zlib.compress(bytes(3_000_000), 9)),
    (b"eXIf", b"II*\0\x08\0\0\0\xff\xff" + bytes(range(256))),
    (b"acTL", struct.pack(">II", 2**31 - 1, 0)),
    (b"fcTL", bytes(26)),
    (b"PLTE", bytes(range(48))),
    (b"tRNS", b"\0\7"),
    (b"gAMA", struct.pack(">I", 1)),
    (b"cHRM", bytes(32)),
    (b"pHYs", b"\xff" * 9),
    (b"sBIT", b"\xff\xff\xff\xff"),
    (b"bKGD", b""),
    (b"ABCD", b"critical and unknown"),
    (b"\0\0\0\0", b""),
)


def chunk(kind: bytes, data: bytes) -> bytes:
    """A chunk with its checksum."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def chunks(content: bytes) -> list[tuple[bytes, bytes]]:
    """Kind and data of the chunks of a whole file."""
    found, place = [], len(SIGNATURE)
    while place + 8 <= len(content):
        (length,) = struct.unpack_from(">I", content, place)
        found.append((content[place + 4 : place + 8], content[place + 8 : place + 8 + length]))
        place += 12 + length
    return found


def forged(content: bytes, rng: np.random.Generator) -> bytes:
    """The file with a chunk changed, left out, doubled, moved or added."""
    parts = chunks(content)
    one = int(rng.integers(len(parts)))
    kind = int(rng.integers(7))
    if kind == 0:
        parts[one] = (parts[one][0], damaged(parts[one][1], b"\0", rng) if parts[one][1] else b"\0")
    elif kind == 1:
        del parts[one]
    elif kind == 2:
        parts.insert(int(rng.integers(len(parts))), parts[one])
    elif kind == 3:
        parts.insert(int(rng.integers(len(parts))), FURTHER[int(rng.integers(len(FURTHER)))])
    elif kind == 4:
        parts[0] = (b"IHDR", _header(bytearray(parts[0][1]), rng))
    else:
        parts = [(name, _repacked(data, rng) if name == b"IDAT" else data) for name, data in parts]
    return SIGNATURE + b"".join(chunk(name, data) for name, data in parts)


def _header(header: bytearray, rng: np.random.Generator) -> bytes:
    """Another width or height, depth, colour or interlacing."""
    place = int(rng.integers(7))
    if place < 2:
        value = EXTREMES[int(rng.integers(len(EXTREMES)))] & 0xFFFFFFFF
        struct.pack_into(">I", header, 4 * place, value if rng.random() < 0.5 else int(rng.integers(1, 100)))
    else:
        header[6 + place] = int(rng.choice([0, 1, 2, 3, 4, 6, 8, 16, 32, 255]))
    return bytes(header)


def _repacked(data: bytes, rng: np.random.Generator) -> bytes:
    """The rows damaged, and compressed as they should be; or a thousand times as many."""
    try:
        rows = zlib.decompress(data)
    except zlib.error:
        return data
    return zlib.compress(rows * 1000 if rng.random() < 0.1 else damaged(rows, rows, rng), 6)
