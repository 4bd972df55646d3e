"""Image files: decoding to grey levels, encoding of raw frames, and silencing of decoders."""

from __future__ import annotations

import hashlib
import io
import logging
import os
import sys
import threading
import warnings
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image, UnidentifiedImageError

from tsis.errors import FileInputError, InputError, import_extra
from tsis.files.images import (
    LARGEST_PIXELS,
    QUICK_PNG,
    encode_picture,
    image_fault,
    rows_missing,
    size_fault,
    without_metadata,
)
from tsis.files.reading import as_path, one_line, printable_name, printable_path, read_bytes, read_head
from tsis.model.image import TactileImage

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray


_FFMPEG_LEVEL, _FFMPEG_SILENT = "OPENCV_FFMPEG_LOGLEVEL", "-8"
# warnings.catch_warnings and the two log levels belong to the whole process, so one thread at a time may change them
_lock = threading.Lock()


@contextmanager
def quiet_decoders() -> Iterator[None]:
    """Silence Pillow and OpenCV inside the block, and restore their levels after it."""
    pillow = logging.getLogger("PIL")
    with _lock, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pillow_level = pillow.level
        pillow.setLevel(logging.CRITICAL + 1)
        loaded = sys.modules.get("cv2")
        logs = None if loaded is None else loaded.utils.logging
        opencv_level = logs and logs.setLogLevel(logs.LOG_LEVEL_SILENT)
        try:
            yield
        finally:
            if logs:
                logs.setLogLevel(opencv_level)
            pillow.setLevel(pillow_level)


@contextmanager
def quiet_ffmpeg() -> Iterator[None]:
    """Silence FFmpeg inside OpenCV, unless the environment sets its level.

    OpenCV reads the level once, when the process first opens a video.
    """
    if _FFMPEG_LEVEL in os.environ:
        yield
        return
    os.environ[_FFMPEG_LEVEL] = _FFMPEG_SILENT
    try:
        yield
    finally:
        os.environ.pop(_FFMPEG_LEVEL, None)


def opencv(feature: str) -> Any:
    """The module ``cv2``; `MissingExtraError` where it is not installed."""
    return import_extra("cv2", feature=feature, extra="camera")


RED_WEIGHT, BLUE_WEIGHT = 0.2126, 0.0722


def luma(colour: NDArray[Any]) -> NDArray[np.float64]:
    """Rec. 709 luma of the stored values: ``0.2126 R + 0.7152 G + 0.0722 B``, on their scale.

    Gamma is not removed, because a camera file does not state which one was applied.

    Examples
    --------
    >>> luma(np.array([[[7, 7, 7], [255, 0, 0]]])).round(3).tolist()
    [[7.0, 54.213]]
    """
    levels: NDArray[np.float64] = np.asarray(colour, dtype=float)
    red, green, blue = levels[..., 0], levels[..., 1], levels[..., 2]
    # written as differences from green so that a grey pixel keeps its level exactly
    grey: NDArray[np.float64] = green + RED_WEIGHT * (red - green) + BLUE_WEIGHT * (blue - green)
    return grey


def grey_of_opencv(pixels: NDArray[Any]) -> NDArray[Any]:
    """Grey levels of an OpenCV frame, grey or blue-green-red."""
    if pixels.ndim == 2:
        return pixels
    return pixels[..., 0] if pixels.shape[2] == 1 else luma(pixels[..., 2::-1])


_MAGIC = (b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff", b"BM", b"II", b"MM")
_FORMATS = ("PNG", "JPEG", "BMP", "TIFF")
_GREY_MODES, _COLOUR_MODES = frozenset({"L", "LA", "I;16", "I;16L", "I;16B"}), frozenset({"RGB", "RGBA", "RGBX"})
_REFUSED_MODES = {
    "1": "1-bit black and white",
    "P": "palette colours",
    "PA": "palette colours",
    "I": "32-bit or signed integers",
    "F": "floating-point values",
    "CMYK": "CMYK colours",
}


def read_image(
    path: str | os.PathLike[str],
    *,
    mm_per_pixel: tuple[float, float] | None = None,
    force_n: float | None = None,
) -> TactileImage:
    """Read one image file as a grey tactile image.

    Parameters
    ----------
    path
        A PNG, JPEG, BMP or TIFF file, grey or colour, 8 or 16 bits a channel, at most 65 million pixels.
    mm_per_pixel
        Size (x, y) of a pixel on the face in mm; None when unknown.
    force_n
        Force of the press in newtons; None when unknown.

    Returns
    -------
    The image; ``name`` is the file's name, ``settings`` contain the file's format, kind, bits and SHA-256.

    Raises
    ------
    FileInputError
        When the file is missing, not a regular file, empty, cut short, corrupt, too large or of an unsupported kind.
    InputError
        When the pixel size or the force lies outside its range.
    """
    source = as_path(path)
    levels, provenance = _decode(source)
    return TactileImage(
        grey=luma(levels) if levels.ndim == 3 else levels,
        mm_per_pixel=mm_per_pixel,
        full_scale=float(np.iinfo(levels.dtype).max),
        force_n=force_n,
        name=printable_name(source),
        settings=provenance,
    )


def read_levels(path: str | os.PathLike[str]) -> NDArray[Any]:
    """Read an image file as stored: shape (rows, columns), or (rows, columns, 3) red-green-blue; uint8 or uint16.

    Raises `FileInputError` as `read_image`. The array is read-only.
    """
    levels, _ = _decode(as_path(path))
    levels.flags.writeable = False
    return levels


def _decode(path: Path) -> tuple[NDArray[Any], dict[str, Any]]:
    """Levels, (rows, columns) or (rows, columns, 3) in red-green-blue order, and their provenance."""
    name = printable_path(path)
    if not read_head(path).startswith(_MAGIC):
        raise FileInputError(f"{name} must be a PNG, JPEG, BMP or TIFF file; got something else")
    data = read_bytes(path)
    broken = image_fault(data)
    if broken is not None:
        raise FileInputError(f"{name} must be a complete image file, but {broken}; copy or save it again")
    try:
        with quiet_decoders(), Image.open(io.BytesIO(data), formats=_FORMATS) as image:
            _require_supported(name, image, data)
            levels, kind = _levels(image, data)
            file_format = image.format
    except FileInputError:
        raise
    except UnidentifiedImageError as error:
        raise FileInputError(f"{name} must be a PNG, JPEG, BMP or TIFF file; got something else") from error
    except Image.DecompressionBombError as error:
        raise FileInputError(f"{name} must hold at most {LARGEST_PIXELS} pixels; it declares more") from error
    except Exception as error:  # hostile bytes make decoders raise nearly anything
        raise FileInputError(f"{name} must be a readable image file; decoding failed: {one_line(error)}") from error
    provenance = {
        "format": file_format,
        "kind": kind,
        "bits": 8 * levels.dtype.itemsize,
        "sha256": hashlib.sha256(data).hexdigest(),
    }
    return levels, provenance


def _require_supported(name: str, image: Image.Image, data: bytes) -> None:
    """Refuse unsupported files by their header, before a pixel is decoded."""
    level_bytes = 2 if image.mode.startswith("I;16") or _stored_bits(image) == 16 else 1
    pixel_bytes = level_bytes * len(image.getbands())
    broken = size_fault(*image.size, len(data), kind=image.format or "", pixel_bytes=pixel_bytes)
    if broken is not None:
        raise FileInputError(f"{name} must hold {broken}")
    if image.mode not in _GREY_MODES | _COLOUR_MODES:
        kind = _REFUSED_MODES.get(image.mode, f"pixels of kind {image.mode}")
        cure = "save it as 8-bit grey PNG"
        raise FileInputError(f"{name} must hold 8- or 16-bit grey or RGB pixels; got {kind} ({cure})")
    pictures = getattr(image, "n_frames", 1)
    if pictures != 1:
        raise FileInputError(f"{name} must hold one picture; got {pictures} (save each as its own file)")
    if rows_missing(data):
        raise FileInputError(f"{name} must hold all pixels that it declares; some are missing or damaged")


def _levels(image: Image.Image, data: bytes) -> tuple[NDArray[Any], str]:
    """Decode the pixels, with 16 bits where the file has them."""
    colour = image.mode in _COLOUR_MODES
    if _stored_bits(image) == 16 and not image.mode.startswith("I;16"):
        levels = _levels_by_opencv(data)
        if levels.shape[1::-1] != image.size:
            raise ValueError(f"its header declares {image.size} and its pixels are {levels.shape[1::-1]}")
    else:
        levels = np.asarray(image)
        levels = levels.astype(levels.dtype.newbyteorder("="))
    if levels.ndim == 3:
        levels = levels[..., :3] if colour else levels[..., 0]
    return np.ascontiguousarray(levels), "colour" if colour else "grey"


def _stored_bits(image: Image.Image) -> int:
    """Bits per channel; Pillow shows them only in the arguments of its decoder, e.g. ``"RGB;16B"``."""
    tiles = getattr(image, "tile", ())
    return 16 if any(";16" in str(tile.args) for tile in tiles) else 8


def _levels_by_opencv(data: bytes) -> NDArray[Any]:
    """Decode 16-bit colour, which Pillow reduces to 8 bits."""
    cv2 = opencv("a 16-bit colour file")
    decoded: NDArray[Any] | None = cv2.imdecode(np.frombuffer(without_metadata(data), np.uint8), cv2.IMREAD_UNCHANGED)
    if decoded is None or decoded.dtype not in (np.uint8, np.uint16):
        raise ValueError("its pixels are cut short or damaged")
    return decoded if decoded.ndim == 2 else decoded[..., 2::-1]  # OpenCV keeps blue first


def png_bytes(image: TactileImage) -> bytes:
    """Encode a raw frame as a grey PNG, 8 bits when its full scale is at most 255, else 16.

    Raises `InputError` as `whole_levels`: the file would lose information, or could not be read back.

    Examples
    --------
    >>> png_bytes(TactileImage(grey=np.eye(8)))[1:4]
    b'PNG'
    """
    return encode_picture(whole_levels(image.grey, image.full_scale), level=QUICK_PNG)


def whole_levels(grey: NDArray[Any], full_scale: float) -> NDArray[Any]:
    """Grey levels as whole numbers of 8 bits when the full scale is at most 255, else of 16.

    Raises `InputError` when they are not whole numbers in [0, full_scale], or there are too many pixels.
    """
    if grey.size > LARGEST_PIXELS:
        raise InputError(f"grey must have at most {LARGEST_PIXELS} pixels to be stored; got {grey.shape}")
    dtype = np.uint8 if full_scale <= 255 else np.uint16
    if grey.dtype == dtype and full_scale >= np.iinfo(dtype).max:
        return grey
    lowest, highest = float(grey.min()), float(grey.max())
    if lowest < 0 or highest > full_scale or not np.array_equal(np.rint(grey), grey):
        raise InputError(
            f"grey must hold whole numbers in [0, {full_scale:g}] to be stored without loss; "
            f"got levels from {lowest:g} to {highest:g}"
        )
    return grey.astype(dtype)
