"""Is an image file whole? Checked by its own structure, so that it does not depend on how lenient a decoder is."""

from __future__ import annotations

import struct
import zlib

_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_JPEG_START, _JPEG_END, _JPEG_SCAN = 0xD8, 0xD9, 0xDA
_JPEG_WITHOUT_LENGTH = frozenset({0x00, 0x01, _JPEG_START, *range(0xD0, 0xD8)})


def png_fault(data: bytes) -> str | None:
    """Walk the chunks of a PNG file to IEND, checking each checksum; None when it is whole."""
    position = len(_PNG_SIGNATURE)
    while position + 12 <= len(data):
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
    position, scanned = 2, False
    while (position := data.find(b"\xff", position)) >= 0 and position + 1 < len(data):
        marker = data[position + 1]
        if marker == 0xFF:  # a fill byte before the marker
            position += 1
        elif marker == _JPEG_END:
            return None if scanned else "it holds no image data"
        elif marker in _JPEG_WITHOUT_LENGTH:
            position += 2
        elif position + 4 <= len(data):
            scanned = scanned or marker == _JPEG_SCAN
            position += 2 + int(struct.unpack_from(">H", data, position + 2)[0])
        else:
            break
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
    r"""Say what is missing from a PNG, JPEG or BMP file; None when it is whole or of another kind.

    TIFF needs no walk here: its decoder refuses a strip that lies outside the file.

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
    return None
