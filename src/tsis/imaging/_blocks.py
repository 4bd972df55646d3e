"""Frames reduced to means over equal blocks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from skimage.transform import resize_local_mean

if TYPE_CHECKING:
    from numpy.typing import NDArray


def block_means(levels: NDArray[Any], shape: tuple[int, int]) -> NDArray[np.float64]:
    """Means over equal blocks that cover a frame; a pixel on the border of two blocks counts in both, by its area.

    Parameters
    ----------
    levels
        Shape (rows, columns), any number type.
    shape
        Rows and columns of blocks, each at least 1 and at most that of the frame.

    Examples
    --------
    >>> block_means(np.array([[1, 2, 6], [3, 4, 8]]), (1, 2)).round(3).tolist()
    [[2.333, 5.667]]
    """
    return np.asarray(resize_local_mean(levels.astype(np.float64), shape))  # type: ignore[no-untyped-call]
