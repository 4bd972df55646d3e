"""Frames reduced to means over blocks, and blurred."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy
import skimage

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
    down, across = (_means(size, blocks) for size, blocks in zip(levels.shape, shape, strict=True))
    return np.ascontiguousarray((across @ (down @ levels.astype(np.float64)).T).T)


@lru_cache(maxsize=16)
def _means(size: int, blocks: int) -> scipy.sparse.csr_array:
    """The means of a line of pixels over equal blocks, as scikit-image has them."""
    return scipy.sparse.csr_array(skimage.transform.resize_local_mean(np.eye(size), (blocks, size)))  # type: ignore[no-untyped-call]


def gaussian_blur(
    grey: NDArray[np.float64], sigma_px: tuple[float, float], *, mode: str = "reflect"
) -> NDArray[np.float64]:
    """The frame as `scipy.ndimage.gaussian_filter` blurs it, up to rounding, but faster.

    Parameters
    ----------
    grey
        Shape (rows, columns).
    sigma_px
        Standard deviations along the rows' index and the columns', pixels.
    mode
        Continuation beyond the border, as SciPy names it.
    """
    down, across = (_matrix(size, sigma, mode) for size, sigma in zip(grey.shape, sigma_px, strict=True))
    origin = grey[0, 0]  # so that a flat frame stays exactly flat
    blurred: NDArray[np.float64] = (across @ (down @ (grey - origin)).T).T + origin
    return np.ascontiguousarray(blurred)


@lru_cache(maxsize=16)
def _matrix(size: int, sigma: float, mode: str) -> scipy.sparse.csr_array:
    """The blur of a line of pixels."""
    return scipy.sparse.csr_array(scipy.ndimage.gaussian_filter1d(np.eye(size), sigma, axis=0, mode=mode))  # type: ignore[call-overload]
