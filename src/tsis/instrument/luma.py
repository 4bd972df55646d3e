"""Colour to grey, by one documented rule."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

RED_WEIGHT, BLUE_WEIGHT = 0.2126, 0.0722


def luma(colour: NDArray[Any]) -> NDArray[np.float64]:
    """Rec. 709 luma of the stored values: ``0.2126 R + 0.7152 G + 0.0722 B``.

    No gamma is undone, because a camera file does not say which one was applied.

    Parameters
    ----------
    colour
        Red, green and blue levels, shape (rows, columns, 3).

    Returns
    -------
    Grey levels, shape (rows, columns), on the scale of the input.

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
    """Grey levels of a frame as OpenCV delivers it: already grey, or blue-green-red."""
    if pixels.ndim == 2:
        return pixels
    return pixels[..., 0] if pixels.shape[2] == 1 else luma(pixels[..., 2::-1])
