"""Frames of a bundle: grey PNG files that are checked before they are decoded."""

from __future__ import annotations

import struct
import zlib
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import FileInputError
from tsis.files import LARGEST_PIXELS, decode_grey_png, png_fault

if TYPE_CHECKING:
    from numpy.typing import NDArray


SIGNATURE = b"\x89PNG\r\n\x1a\n"
PIECE = 2**20  # bytes that are unpacked at once


def read_picture(content: bytes, name: str, rows: int, columns: int) -> NDArray[Any]:
    """Grey levels of a PNG file, shape (rows, columns), uint8 or uint16, read-only; errors call it ``name``.

    `FileInputError` when it is no whole grey PNG file of 8 or 16 bits, has another size, is too large, or has other
    content.
    """
    if rows * columns > LARGEST_PIXELS:
        raise FileInputError(f"{name} must hold at most {LARGEST_PIXELS} pixels; its press says {rows} x {columns}")
    dtype = _require_header(content, name, rows, columns)
    if (broken := png_fault(content)) is None:
        broken = _data_fault(content, rows * (1 + columns * np.dtype(dtype).itemsize))
    if broken is not None:
        raise FileInputError(f"{name} must be a complete PNG file, but {broken}")
    levels = decode_grey_png(content)
    if levels is None or levels.shape != (rows, columns) or levels.dtype != dtype:
        raise FileInputError(f"{name} must be a readable PNG file of {rows} x {columns} grey levels; it is not")
    levels.flags.writeable = False
    return levels


def _require_header(content: bytes, name: str, rows: int, columns: int) -> type:
    if content[:8] != SIGNATURE or content[12:16] != b"IHDR" or len(content) < 33:
        raise FileInputError(f"{name} must be a PNG file; got something else")
    width, height, bits, colour, packing, filtering, interlaced = struct.unpack_from(">IIBBBBB", content, 16)
    if (height, width) != (rows, columns):
        raise FileInputError(f"{name} must be {rows} x {columns} pixels, as its press says; got {height} x {width}")
    if bits not in (8, 16) or (colour, packing, filtering, interlaced) != (0, 0, 0, 0):
        raise FileInputError(f"{name} must hold 8 or 16 bits of grey, not interlaced; got another kind of PNG")
    return np.uint8 if bits == 8 else np.uint16


def _data_fault(content: bytes, size: int) -> str | None:
    """The fault in the chunks of an image of ``size`` bytes, or None.

    Compressed texts and profiles, which can unpack to any size, are refused.
    """
    unpacker, unpacked, position = zlib.decompressobj(), 0, len(SIGNATURE)
    while position < len(content):
        (length,) = struct.unpack_from(">I", content, position)
        kind = content[position + 4 : position + 8]
        if kind == b"IDAT":
            data = content[position + 8 : position + 8 + length]
            try:
                unpacked += _unpacked_bytes(unpacker, data, size + 1 - unpacked)
            except zlib.error as error:
                return f"its data cannot be unpacked: {error}"
        elif kind not in (b"IHDR", b"IEND"):
            return f"it holds a chunk {kind.decode('latin-1')!r} that is no part of a picture"
        position += 12 + length
        if kind == b"IEND":
            break
    if position != len(content) or unpacker.unused_data:
        return "it goes on after its end"
    return None if unpacked == size and unpacker.eof else f"its data do not unpack to {size} bytes"


def _unpacked_bytes(unpacker: Any, data: bytes, most: int) -> int:
    """Unpacked size of ``data``, counted in pieces; the count stops soon after ``most``."""
    unpacked, piece = 0, PIECE
    while unpacked < most and (data or piece == PIECE):  # after a full piece more may follow without more data
        piece = len(unpacker.decompress(data, PIECE))
        data = unpacker.unconsumed_tail
        unpacked += piece
    return unpacked
