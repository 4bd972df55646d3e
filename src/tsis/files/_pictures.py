"""Pictures in memory: PNG, JPEG and BMP files of grey levels or colours, and the levels of a PNG file."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

if TYPE_CHECKING:
    from numpy.typing import NDArray


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

    Call it on content that `tsis.files.png_fault` found whole: the number of pixels is not limited here.
    """
    try:
        with Image.open(io.BytesIO(content), formats=("PNG",)) as picture:
            dtype = LEVEL_TYPES.get(picture.mode)
            return None if dtype is None else np.array(picture).astype(dtype, copy=False)
    except Exception:  # hostile bytes make decoders raise nearly anything
        return None
