"""A frame as bytes for the browser: a header of 32 bytes, then pixels of 8 bits or a JPEG picture; and its words."""

from __future__ import annotations

import json
import math
import struct
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.console.bench.sight import Sight
    from tsis.instrument.acquisition import ReceivedFrame

# magic, encoding, three bytes unused, number of the frame, rows, columns, when it came in ms, full scale, unused
HEADER = struct.Struct("<4sB3xIHHdfI")
MAGIC = b"TSF1"
RAW, JPEG = 0, 1
BITS_8 = 255.0


def is_as_shown(arrival: ReceivedFrame) -> bool:
    """Whether a frame has 255 levels as a screen does, so that `packet` only copies it."""
    return bool(arrival.frame.pixels.dtype == np.uint8 and arrival.frame.full_scale == BITS_8)


def packet(arrival: ReceivedFrame, *, number: int, came_ms: float, jpeg_quality: int | None = None) -> bytes:
    """The newest frame for a viewer.

    Parameters
    ----------
    arrival
        The frame, and when it came.
    number
        How many frames had come with it.
    came_ms
        When it came, on the clock of the wall, ms since 1970: the browser subtracts it from its own.
    jpeg_quality
        In [1, 100]; raw pixels when None.
    """
    levels = display_levels(arrival)
    rows, columns = levels.shape
    encoding = RAW if jpeg_quality is None else JPEG
    header = HEADER.pack(MAGIC, encoding, number % 2**32, rows, columns, came_ms, arrival.frame.full_scale, 0)
    if jpeg_quality is None:
        return header + levels.tobytes()
    return header + cv2.imencode(".jpg", levels, [cv2.IMWRITE_JPEG_QUALITY, jpeg_quality])[1].tobytes()


def display_levels(arrival: ReceivedFrame) -> NDArray[np.uint8]:
    """Grey levels with 255 at full scale, shape (rows, columns), uint8: a screen shows no more."""
    pixels, full_scale = np.asarray(arrival.frame.pixels), arrival.frame.full_scale
    if is_as_shown(arrival):
        return pixels
    scaled = np.clip(pixels.astype(np.float32) * (BITS_8 / full_scale), 0.0, BITS_8)
    return np.asarray(np.rint(scaled), dtype=np.uint8)


def sight_text(sight: Sight | None) -> str:
    """What a frame shows, as JSON; ``null`` stands for what is not finite, and where nothing is known."""
    return json.dumps(None if sight is None else _finite(asdict(sight)), allow_nan=False)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _finite(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
