"""Compiled loops over the pixels of a frame: one pass over memory where NumPy needs a dozen.

Means over blocks and blurs of frames are products with sparse matrices.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy
import skimage

from tsis.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray


@compiled
def paint(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    radius: NDArray[np.float64],
    glow: NDArray[np.float64],
    displacement: NDArray[np.float64],
    slope: NDArray[np.float64],
    map_x: NDArray[np.float64],
    map_y: NDArray[np.float64],
    relative: NDArray[np.float64],
    flux_x: NDArray[np.float64],
    flux_y: NDArray[np.float64],
    growth: NDArray[np.float64],
    bend: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Picture of a round press under a map of light, dark outside.

    ``glow(r) E0 exp((growth + bend u(r)) u(r)) (1 + slope(r) (Fx x + Fy y) / r)`` with the displacement u and with E0,
    growth, bend, Fx and Fy at (x, y). Profiles are linear between radii, maps between nodes and constant beyond them.
    """
    picture = np.zeros((len(y), len(x)))
    column, right = _interval_positions(x, map_x)
    line, below = _interval_positions(y, map_y)
    e, fx, fy = np.empty(len(map_x)), np.empty(len(map_x)), np.empty(len(map_x))
    g, b = np.empty(len(map_x)), np.empty(len(map_x))
    grows = np.any(growth != 0) or np.any(bend != 0)
    last = len(radius) - 1
    near = last - 1  # the radius changes little from pixel to pixel, so few steps find its interval
    for i in range(len(y)):
        top = line[i]
        for k in range(len(map_x)):
            e[k] = relative[top, k] + below[i] * (relative[top + 1, k] - relative[top, k])
            fx[k] = flux_x[top, k] + below[i] * (flux_x[top + 1, k] - flux_x[top, k])
            fy[k] = flux_y[top, k] + below[i] * (flux_y[top + 1, k] - flux_y[top, k])
            g[k] = growth[top, k] + below[i] * (growth[top + 1, k] - growth[top, k])
            b[k] = bend[top, k] + below[i] * (bend[top + 1, k] - bend[top, k])
        for j in range(len(x)):
            r = np.sqrt(x[j] * x[j] + y[i] * y[i])
            if r > radius[last]:
                continue
            while near > 0 and r < radius[near]:
                near -= 1
            while near < last - 1 and r >= radius[near + 1]:
                near += 1
            part = (r - radius[near]) / (radius[near + 1] - radius[near])
            shine = glow[near] + part * (glow[near + 1] - glow[near])
            k, w = column[j], right[j]
            if grows:
                dent = displacement[near] + part * (displacement[near + 1] - displacement[near])
                rate = g[k] + w * (g[k + 1] - g[k]) + dent * (b[k] + w * (b[k + 1] - b[k]))
                shine *= np.exp(dent * rate)
            tilt = 1.0
            if r > 0:
                rise = (slope[near] + part * (slope[near + 1] - slope[near])) / r
                tilt += rise * x[j] * (fx[k] + w * (fx[k + 1] - fx[k]))
                tilt += rise * y[i] * (fy[k] + w * (fy[k + 1] - fy[k]))
            picture[i, j] = shine * (e[k] + w * (e[k + 1] - e[k])) * max(tilt, 0.0)
    return picture


@compiled
def _interval_positions(
    at: NDArray[np.float64], knots: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Interval of knots of each coordinate and position in it, from 0 to 1; coordinates outside lie on the edge."""
    index, part = np.empty(len(at), np.int64), np.empty(len(at))
    for i in range(len(at)):
        k = min(max(np.searchsorted(knots, at[i]) - 1, 0), len(knots) - 2)
        index[i] = k
        part[i] = min(max((at[i] - knots[k]) / (knots[k + 1] - knots[k]), 0.0), 1.0)
    return index, part


@compiled
def develop(
    frame: NDArray[np.float64], light: NDArray[np.float64], background: float, read: float, shot: float, top: float
) -> None:
    """Convert standard normal numbers to the frame of ``light``, in place: background, noise, rounding, clipping."""
    for i in range(light.shape[0]):
        for j in range(light.shape[1]):
            deviation = np.sqrt(read * read + shot * max(light[i, j], 0.0))
            frame[i, j] = min(max(np.rint(light[i, j] + background + deviation * frame[i, j]), 0.0), top)


@compiled
def ring_sums(
    grey: NDArray[np.float64], clipped: NDArray[np.bool_], rings: NDArray[np.intp], count: int, level: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Pixels, clipped pixels, and sums and squares of ``grey - level`` over the other pixels, by ring.

    Pixels with a ring index of ``count`` or more lie outside all rings.
    """
    pixels, lost = np.zeros(count, np.int64), np.zeros(count, np.int64)
    total, square = np.zeros(count), np.zeros(count)
    for i in range(len(grey)):
        ring = rings[i]
        if ring >= count:
            continue
        if clipped[i]:
            lost[ring] += 1
            continue
        deviation = grey[i] - level
        pixels[ring] += 1
        total[ring] += deviation
        square[ring] += deviation * deviation
    return pixels, lost, total, square


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
