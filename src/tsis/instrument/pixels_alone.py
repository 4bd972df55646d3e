"""A picture's bytes without what is no pixel, so that nothing else ever reaches a decoder.

Comments, colour profiles and camera notes may be packed, nested and cross-referenced; a decoder that unpacks them can
be made to take gigabytes for a picture of a few pixels. None of them changes a pixel here: values and rows are those
stored.
"""

from __future__ import annotations

import struct

_SIGNATURE_BYTES = 8
_PNG_KEPT = frozenset(
    {b"tRNS", b"acTL", b"fcTL", b"fdAT"}
)  # beside the critical ones: they tell kind and number of pictures
_JPEG_ADOBE, _JPEG_SCAN_START, _PICTURES = 0xEE, 0xDA, b"MPF\0"
_JPEG_NOTES = frozenset({*range(0xE1, 0xF0), 0xFE}) - {_JPEG_ADOBE}


def png_pixels(data: bytes) -> bytes:
    """A whole PNG file without ancillary chunks; the same object when it has none."""
    kept, place, kind = [data[:_SIGNATURE_BYTES]], _SIGNATURE_BYTES, b""
    while kind != b"IEND":
        (length,) = struct.unpack_from(">I", data, place)
        kind, end = data[place + 4 : place + 8], place + 12 + length
        critical = not kind[0] & 0x20  # a capital letter
        if critical or kind in _PNG_KEPT:
            kept.append(memoryview(data)[place:end])  # type: ignore[arg-type]  # joins as bytes do
        place = end
    return data if sum(map(len, kept)) == len(data) else b"".join(kept)


def jpeg_pixels(data: bytes) -> bytes:
    """A whole JPEG file without segments of notes before its first scan; the same object when it has none."""
    kept, place = [data[:2]], 2
    while True:
        while data[place + 1] == 0xFF:  # fill bytes
            place += 1
        marker = data[place + 1]
        if data[place] != 0xFF or not 0xC0 <= marker <= 0xFE or marker == _JPEG_SCAN_START or 0xD0 <= marker <= 0xD9:
            break  # pixels, or something that the decoder shall judge
        end = place + 2 + int(struct.unpack_from(">H", data, place + 2)[0])
        if marker not in _JPEG_NOTES or data[place + 4 : place + 8] == _PICTURES:
            kept.append(data[place:end])
        place = end
    if sum(map(len, kept)) == place:
        return data
    return b"".join([*kept, data[place:]])


def pixels_alone(data: bytes) -> bytes:
    """The file as a decoder should see it; it must have been found whole before (`tsis.instrument.completeness`)."""
    if data.startswith(b"\x89PNG"):
        return png_pixels(data)
    return jpeg_pixels(data) if data.startswith(b"\xff\xd8") else data
