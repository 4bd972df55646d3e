"""Is an image file whole, and no trap? Checked by its own structure, however lenient or greedy a decoder is."""

from __future__ import annotations

import re
import struct
import zlib

from tsis.instrument.tiff_directory import tiff_fault

_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_JPEG_END, _JPEG_SCAN = 0xD9, 0xDA
_JPEG_MARKER = re.compile(rb"\xff[\x02-\xcf\xd9-\xfe]")  # the others have no length: stuffing, restarts, fill bytes
MOST_CHUNKS, MOST_SEGMENTS, MOST_SCANS, MOST_SCANNED = 100_000, 4000, 100, 1_000_000_000  # no encoder comes near
_JPEG_FRAMES = frozenset({*range(0xC0, 0xD0)}) - {0xC4, 0xC8, 0xCC}


def png_fault(data: bytes) -> str | None:
    """Walk the chunks of a PNG file to IEND, checking each checksum; None when it is whole."""
    position, chunks = len(_PNG_SIGNATURE), 0
    while position + 12 <= len(data):
        chunks += 1
        if chunks > MOST_CHUNKS:
            return f"it has more than {MOST_CHUNKS} chunks"
        (length,) = struct.unpack_from(">I", data, position)
        end = position + 8 + length
        if end + 4 > len(data):
            break
        kind = data[position + 4 : position + 8]
        if zlib.crc32(data[position + 4 : end]) != struct.unpack_from(">I", data, end)[0]:
            return f"the checksum of its {kind.decode('latin-1')!r} chunk does not match"
        if kind == b"IEND":
            return None
        position = end + 4
    return f"it is truncated: it ends at byte {len(data)} before its IEND chunk"


def jpeg_fault(data: bytes) -> str | None:
    """Walk the markers of a JPEG file to its end-of-image marker; None when it is whole.

    Segments are skipped by their length, so that the end marker of an embedded thumbnail is not taken for the file's.
    """
    position, segments, scans, pixels = 2, 0, 0, 0
    while (found := _JPEG_MARKER.search(data, position)) is not None:
        position, marker = found.start(), data[found.start() + 1]
        if marker == _JPEG_END:
            return None if scans else "it holds no image data"
        if position + (9 if marker in _JPEG_FRAMES else 4) > len(data):
            break
        segments, scans = segments + 1, scans + (marker == _JPEG_SCAN)
        if marker in _JPEG_FRAMES:
            rows, columns = struct.unpack_from(">HH", data, position + 5)
            pixels = max(pixels, rows * columns)
        if segments > MOST_SEGMENTS or scans > MOST_SCANS or scans * pixels > MOST_SCANNED:
            return f"it has {segments} segments and {scans} scans of {pixels} pixels"
        position += 2 + int(struct.unpack_from(">H", data, position + 2)[0])
    return f"it is truncated: it ends at byte {len(data)} before its end-of-image marker"


def bmp_fault(data: bytes) -> str | None:
    """Compare the size that a BMP file declares with its real one; None when it is whole."""
    if len(data) < 26:
        return f"it is truncated: it ends at byte {len(data)} inside its header"
    (declared,) = struct.unpack_from("<I", data, 2)
    if declared > len(data):
        return f"it is truncated: it declares {declared} bytes and has {len(data)}"
    return None


def fault(data: bytes) -> str | None:
    r"""Say what is missing from a picture's file, or what in it is a trap; None when it is whole or of another kind.

    Of TIFF only the directories are walked: its decoder refuses a strip that lies outside the file.

    Examples
    --------
    >>> fault(b"\xff\xd8\xff\xda\x00\x02")
    'it is truncated: it ends at byte 6 before its end-of-image marker'
    """
    if data.startswith(_PNG_SIGNATURE):
        return png_fault(data)
    if data.startswith(b"\xff\xd8"):
        return jpeg_fault(data)
    if data.startswith(b"BM"):
        return bmp_fault(data)
    if data.startswith((b"II", b"MM")):
        return tiff_fault(data)
    return None
