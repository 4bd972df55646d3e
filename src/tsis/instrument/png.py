"""Frames as lossless PNG files."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from tsis.instrument.picture_size import LARGEST_PIXELS
from tsis.model.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model import TactileImage

QUICK = (cv2.IMWRITE_PNG_COMPRESSION, 1)  # half the time of the default for a tenth more bytes


def png_bytes(image: TactileImage) -> bytes:
    """Encode a raw frame as a grey PNG, 8 bits when its full scale is at most 255, else 16.

    Raises
    ------
    InputError
        As `whole_levels`: the file would not hold what was seen, or could not be read back.

    Examples
    --------
    >>> from tsis.model import TactileImage
    >>> png_bytes(TactileImage(grey=np.eye(8)))[1:4]
    b'PNG'
    """
    return bytes(cv2.imencode(".png", whole_levels(image.grey, image.full_scale))[1].tobytes())


def whole_levels(grey: NDArray[Any], full_scale: float) -> NDArray[Any]:
    """Grey levels as whole numbers of 8 bits when the full scale is at most 255, else of 16.

    Raises
    ------
    InputError
        When they are not whole numbers in [0, full_scale], or more than a file may hold that is read back.
    """
    if grey.size > LARGEST_PIXELS:
        raise InputError(f"grey must have at most {LARGEST_PIXELS} pixels to be stored; got {grey.shape}")
    wanted = np.uint8 if full_scale <= 255 else np.uint16
    if grey.dtype == wanted and full_scale >= np.iinfo(wanted).max:
        return grey
    lowest, highest = float(grey.min()), float(grey.max())
    if lowest < 0 or highest > full_scale or not np.array_equal(np.rint(grey), grey):
        raise InputError(
            f"grey must hold whole numbers in [0, {full_scale:g}] to be stored without loss; "
            f"got levels from {lowest:g} to {highest:g}"
        )
    return grey.astype(wanted)
