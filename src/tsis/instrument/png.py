"""Frames as lossless PNG files."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from tsis.model.errors import InputError

if TYPE_CHECKING:
    from tsis.model import TactileImage


def png_bytes(image: TactileImage) -> bytes:
    """Encode a raw frame as a grey PNG, 8 bits when its full scale is at most 255, else 16.

    Raises
    ------
    InputError
        When grey levels are not whole numbers in [0, full_scale], so that the file would not hold what was seen.

    Examples
    --------
    >>> from tsis.model import TactileImage
    >>> png_bytes(TactileImage(grey=np.eye(8)))[1:4]
    b'PNG'
    """
    lowest, highest = float(image.grey.min()), float(image.grey.max())
    if lowest < 0 or highest > image.full_scale or not np.array_equal(np.rint(image.grey), image.grey):
        raise InputError(
            f"grey must hold whole numbers in [0, {image.full_scale:g}] to be stored without loss; "
            f"got levels from {lowest:g} to {highest:g}"
        )
    levels = image.grey.astype(np.uint8) if image.full_scale <= 255 else image.grey.astype(np.uint16)
    return bytes(cv2.imencode(".png", levels)[1].tobytes())
