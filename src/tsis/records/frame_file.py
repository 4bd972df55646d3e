"""A frame as a stored file: PNG, lossless, 8 or 16 bits."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from tsis.instrument.completeness import fault
from tsis.instrument.png import QUICK, whole_levels
from tsis.model.errors import RecordsError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model import TactileImage


def frame_bytes(image: TactileImage) -> bytes:
    """Content of the file of a frame; `InputError` when its levels are not whole numbers in [0, full_scale]."""
    return bytes(cv2.imencode(".png", whole_levels(image.grey, image.full_scale), QUICK)[1].tobytes())


def frame_levels(content: bytes, name: str) -> NDArray[Any]:
    """Grey levels of a file whose hash was found right, shape (rows, columns), uint8 or uint16; read-only.

    Raises
    ------
    RecordsError
        When it is no such file all the same; ``name`` says which.
    """
    levels = None
    if fault(content) is None:
        levels = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)
    if levels is None or levels.ndim != 2:
        raise RecordsError(f"frame {name[:12]} must be a grey PNG file; it is not (tsis records verify)")
    levels.flags.writeable = False
    return levels
