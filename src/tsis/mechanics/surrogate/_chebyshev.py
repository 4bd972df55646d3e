"""Chebyshev interpolation on a box, one axis at a time."""

from __future__ import annotations

from functools import cache, lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import chebyshev

if TYPE_CHECKING:
    from tsis.mechanics._element import Floats


def points(interval: tuple[float, float], count: int) -> Floats:
    """The ``count`` Chebyshev points of the first kind on ``interval``, ascending."""
    low, high = interval
    unit = -np.cos(np.pi * (np.arange(count) + 0.5) / count)
    return np.asarray((low + high) / 2 + (high - low) / 2 * unit)


def weights(interval: tuple[float, float], count: int, x: Floats) -> Floats:
    """Matrix from values at `points` to the interpolating polynomial at ``x``, shape (len(x), count)."""
    low, high = interval
    unit = (2 * np.atleast_1d(x) - low - high) / (high - low)
    # NumPy's own recurrence spends more time on checks than on work for few points.
    terms = np.ones((count, unit.size))
    if count > 1:
        terms[1] = unit
    for n in range(2, count):
        terms[n] = 2 * unit * terms[n - 1] - terms[n - 2]
    return np.asarray(terms.T @ _coefficients(count))


@lru_cache(maxsize=1024)  # callers repeat few positions
def weights_at(interval: tuple[float, float], count: int, x: float) -> Floats:
    """`weights` at one position, shape (count,)."""
    row = np.array(weights(interval, count, np.array([x]))[0])
    row.flags.writeable = False
    return row


@cache
def _coefficients(count: int) -> Floats:
    """Matrix from values at the points to Chebyshev coefficients."""
    matrix = np.asarray(np.linalg.inv(chebyshev.chebvander(points((-1.0, 1.0), count), count - 1)), dtype=float)
    matrix.flags.writeable = False
    return matrix
