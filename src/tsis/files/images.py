"""Image files in memory: bounds, wholeness; PNG, JPEG and BMP."""

from __future__ import annotations

import io
import re
import struct
import zlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray


MOST_ENTRIES, MOST_DIRECTORIES, MOST_NUMBER_BYTES = 4096, 16, 4 * 2**20
SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 6: 1, 7: 1, 8: 2, 9: 4, 10: 8, 11: 4, 12: 8, 13: 4, 16: 8, 17: 8, 18: 8}
TEXT_TYPES = frozenset({1, 2, 6, 7})
DECISIVE = frozenset({256, 257, 258, 259, 262, 266, 273, 277, 278, 279, 284, 317, 322, 323, 324, 325, 339})
WIDTH, HEIGHT, WHOLE_NUMBERS = 256, 257, frozenset({3, 4, 16})


@dataclass(frozen=True, slots=True)
class _Form:
    """Format of offsets: 4 bytes in classic files, 8 in large ones."""

    order: str
    large: bool

    def number(self, data: bytes, index: int) -> int:
        """An offset or count."""
        return int(struct.unpack_from(self.order + ("Q" if self.large else "I"), data, index)[0])


def tiff_fault(data: bytes) -> str | None:
    """The fault in the directories of a TIFF file, or None."""
    order = "<" if data.startswith(b"II") else ">"
    try:
        form = _Form(order, large=struct.unpack_from(order + "H", data, 2)[0] == 43)
        position, directories = form.number(data, 8 if form.large else 4), 0
        while position:
            directories += 1
            if directories > MOST_DIRECTORIES:
                return f"it lists more than {MOST_DIRECTORIES} pictures"
            entries = struct.unpack_from(order + ("Q" if form.large else "H"), data, position)[0]
            if not 0 < entries <= MOST_ENTRIES:
                return f"a directory of it lists {entries} entries"
            if (broken := _directory_fault(list(_entries(data, position, entries, form)), len(data))) is not None:
                return broken
            position = form.number(data, position + (8 + 20 * entries if form.large else 2 + 12 * entries))
    except (struct.error, OverflowError):  # a position beyond the end
        return f"it is truncated: it ends at byte {len(data)} before a directory that it names"
    return None


def _entries(data: bytes, index: int, entries: int, form: _Form) -> Iterator[tuple[int, int, int]]:
    """Tag, kind and count of each entry."""
    first, step = (index + 8, 20) if form.large else (index + 2, 12)
    for number in range(entries):
        tag, kind = struct.unpack_from(form.order + "HH", data, first + step * number)
        yield tag, kind, form.number(data, first + step * number + 4)


def _directory_fault(entries: list[tuple[int, int, int]], size: int) -> str | None:
    decisive = [tag for tag, _, _ in entries if tag in DECISIVE]  # other tags may occur twice in valid files
    if len(set(decisive)) < len(decisive):
        return "a directory of it says twice how large or of what kind its picture is"
    if any(tag in (WIDTH, HEIGHT) and (kind not in WHOLE_NUMBERS or count != 1) for tag, kind, count in entries):
        return "a directory of it does not state its width and height as one whole number each"
    texts = sum(count * SIZES.get(kind, 1) for _, kind, count in entries if kind in TEXT_TYPES)
    numbers = sum(count * SIZES.get(kind, 1) for _, kind, count in entries if kind not in TEXT_TYPES)
    if texts > size or numbers > min(size, MOST_NUMBER_BYTES):
        return f"a directory of it lists {texts + numbers} bytes"
    return None


_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_JPEG_END, _JPEG_SCAN = 0xD9, 0xDA
_JPEG_MARKER = re.compile(rb"\xff[\x02-\xcf\xd9-\xfe]")  # others have no length: stuffing, restarts, fill bytes
MOST_CHUNKS, MOST_SEGMENTS, MOST_SCANS, MOST_SCANNED = 100_000, 4000, 100, 1_000_000_000  # far above any encoder
_JPEG_FRAMES = frozenset({*range(0xC0, 0xD0)}) - {0xC4, 0xC8, 0xCC}


def png_fault(data: bytes) -> str | None:
    """The fault in the chunks and checksums of a PNG file, or None."""
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
    """The fault in the markers of a JPEG file, or None.

    Segments are skipped by their length, so the end marker of an embedded thumbnail does not count.
    """
    position, segments, scans, pixels = 2, 0, 0, 0
    while (match := _JPEG_MARKER.search(data, position)) is not None:
        position, marker = match.start(), data[match.start() + 1]
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
    """The fault in the declared size of a BMP file, or None."""
    if len(data) < 26:
        return f"it is truncated: it ends at byte {len(data)} inside its header"
    (declared,) = struct.unpack_from("<I", data, 2)
    if declared > len(data):
        return f"it is truncated: it declares {declared} bytes and has {len(data)}"
    return None


def image_fault(data: bytes) -> str | None:
    r"""The fault in the structure of an image file; None when it is whole or of another format.

    Pillow, which decodes, takes what is refused here: PNG with changed or lost chunks, JPEG that is cut or repeats a
    scan for minutes, BMP with lost rows; its TIFF decoder prints warnings and takes memory for forged directories. For
    TIFF only the directories are checked: the decoder refuses a strip outside the file.

    Examples
    --------
    >>> image_fault(b"\xff\xd8\xff\xda\x00\x02")
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


# Chunks that affect the pixels, beside the critical ones.
_PNG_COLOUR_CHUNKS = frozenset({b"tRNS", b"acTL", b"fcTL", b"fdAT"})


def without_metadata(data: bytes) -> bytes:
    """A whole PNG file without metadata, of which libpng prints warnings; the same object when it has none.

    Files of other formats are returned as they are; check the file with `image_fault` before.
    """
    if not data.startswith(_PNG_SIGNATURE):
        return data
    kept, position, kind = [_PNG_SIGNATURE], len(_PNG_SIGNATURE), b""
    while kind != b"IEND":
        (length,) = struct.unpack_from(">I", data, position)
        kind, end = data[position + 4 : position + 8], position + 12 + length
        critical = not kind[0] & 0x20  # a capital letter
        if critical or kind in _PNG_COLOUR_CHUNKS:
            kept.append(memoryview(data)[position:end])  # type: ignore[arg-type]  # joins as bytes do
        position = end
    return data if sum(map(len, kept)) == len(data) else b"".join(kept)


LARGEST_PIXELS = 65_000_000  # sensors sold as 64 million have 64.1 to 64.5
FREE_PIXELS, PIXELS_A_BYTE = 16_000_000, 24
FREE_BYTES = 3 * LARGEST_PIXELS  # of levels: colour of 8 bits, or grey of 16
MOST_PIXELS_A_BYTE = {"PNG": 1032, "JPEG": 512}  # deflate packs no further; a block of 64 pixels takes a bit
_PIECE = 4096  # packed bytes; each unpacks to at most 1032
# first column and step, first row and step of each pass
_WHOLE = ((0, 1, 0, 1),)
_ADAM7 = ((0, 8, 0, 8), (4, 8, 0, 8), (0, 4, 4, 8), (2, 4, 0, 4), (0, 2, 2, 4), (1, 2, 0, 2), (0, 1, 1, 2))
_CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}


def size_fault(columns: int, rows: int, file_bytes: int, *, kind: str, pixel_bytes: int) -> str | None:
    """The requirement that an image of this declared size breaks, or None.

    ``kind`` is the format of its file of ``file_bytes``, e.g. ``"PNG"``; ``pixel_bytes`` counts all channels.

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
    """Whether a structurally whole PNG file lacks pixels, which Pillow silently fills with zeros."""
    if not data.startswith(b"\x89PNG"):
        return False
    columns, rows, depth, colour = struct.unpack_from(">IIBB", data, 16)
    bits, interlaced = _CHANNELS.get(colour, 1) * depth, data[28] == 1
    needed = sum(
        high * (1 + -(-wide * bits // 8))
        for left, span, top, down in (_ADAM7 if interlaced else _WHOLE)
        if (wide := -(-(columns - left) // span)) > 0 and (high := -(-(rows - top) // down)) > 0
    )
    unpacker, position, kind, unpacked = zlib.decompressobj(), 8, b"", 0
    view = memoryview(data)
    try:
        while kind != b"IEND" and unpacked < needed:
            (length,) = struct.unpack_from(">I", data, position)
            kind, end = data[position + 4 : position + 8], position + 8 + length
            for start in range(position + 8, end, _PIECE) if kind == b"IDAT" else ():
                unpacked += len(unpacker.decompress(view[start : min(start + _PIECE, end)]))
                if unpacker.eof or unpacked >= needed:
                    return bool(unpacked < needed)
            position += 12 + length
    except zlib.error:
        return True
    return bool(unpacked < needed)


QUICK_PNG = 1  # level of compression: half the time of the default for a tenth more bytes
LEVEL_TYPES = {"L": np.uint8, "I;16": np.uint16, "I;16B": np.uint16}


def encode_picture(pixels: NDArray[Any], kind: str = "png", *, level: int = 6, quality: int = 95) -> bytes:
    """Encode levels as an image file.

    Parameters
    ----------
    pixels
        Grey levels, shape (rows, columns), uint8 or (PNG only) uint16; or
        red-green-blue, shape (rows, columns, 3), uint8.
    kind
        ``"png"``, ``"bmp"`` or ``"jpg"``.
    level
        Compression of PNG, in [0, 9].
    quality
        Quality of JPEG, in [1, 100].

    Examples
    --------
    >>> encode_picture(np.eye(8, dtype=np.uint16))[1:4]
    b'PNG'
    """
    buffer = io.BytesIO()
    picture = Image.fromarray(np.ascontiguousarray(pixels))
    if kind == "png":
        picture.save(buffer, "PNG", compress_level=level)
    elif kind == "jpg":
        picture.save(buffer, "JPEG", quality=quality)
    else:
        picture.save(buffer, "BMP")
    return buffer.getvalue()


def decode_grey_png(content: bytes) -> NDArray[Any] | None:
    """Grey levels of a PNG file, shape (rows, columns), uint8 or uint16; None where it is no readable grey PNG file.

    Call it on content that `tsis.files.images.png_fault` found whole: the number of pixels is not limited here.
    """
    try:
        with Image.open(io.BytesIO(content), formats=("PNG",)) as picture:
            dtype = LEVEL_TYPES.get(picture.mode)
            return None if dtype is None else np.array(picture).astype(dtype, copy=False)
    except Exception:  # hostile bytes make decoders raise nearly anything
        return None
