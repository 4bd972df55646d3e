"""How saturation flattens the light of a Hertzian contact: its middle, its spread and its sum.

Under ``p = p0 sqrt(1 - r**2 / a**2)`` rough contact shows ``g = erf(0.886 x s) / x`` with ``s = p / p0`` and
``x = p0 / saturation``, which is ``s`` for small x. All is written over ``x**2``, in which it is smooth through zero,
so that noise may ask for a little less than no saturation.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial.legendre import leggauss
from scipy.special import erf, erfi

from tsis.calibration.force.reading import HERTZ_SPREAD, MIDDLE
from tsis.optics.asperities import ERF_SLOPE

if TYPE_CHECKING:
    from numpy.typing import NDArray

LOWEST, HIGHEST = -0.5, 4.0  # of x**2: beyond twice the saturation nothing but its level is left
TABLE = 226
POINTS = 48


def light_share(square: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sum of the light over what it would be without saturation, for x², any shape."""
    table = _table()
    return np.asarray(np.interp(square, table[0], table[1]))


def spread_factor(square: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean square distance from the centre over the contact's a²; 1 / HERTZ_SPREAD without saturation."""
    table = _table()
    return np.asarray(np.interp(square, table[0], table[2]))


def peakedness(square: NDArray[np.float64]) -> NDArray[np.float64]:
    """Level of the middle times the mean square distance over the sum; it falls as the light flattens."""
    table = _table()
    return np.asarray(np.interp(square, table[0], table[3]))


@lru_cache(maxsize=1)
def _table() -> tuple[NDArray[np.float64], ...]:
    """x², light share, spread factor, peakedness."""
    square = np.linspace(LOWEST, HIGHEST, TABLE)
    node, weight = leggauss(POINTS)
    u, w = (node + 1) / 2, weight / 2  # s of the contact; areas go with s ds
    light = _shown(square[:, None], u[None, :]) * u
    total = light @ w
    spread = (light * (1 - u**2)) @ w / total
    # The middle: s from sqrt(1 - m**2 a² spread) to 1, where its radius follows the spread that is seen.
    least = np.sqrt(1 - MIDDLE**2 * HERTZ_SPREAD * spread)
    s = least[:, None] + (1 - least[:, None]) * u
    middle = ((_shown(square[:, None], s) * s) @ w) / (s @ w)
    return square, 3 * total, spread, middle * spread / (2 * np.pi * total)


def _shown(square: NDArray[np.float64], s: NDArray[np.float64]) -> NDArray[np.float64]:
    """``erf(0.886 x s) / x`` over x², with its continuation to negative x²; its slope at zero is that of s."""
    root = ERF_SLOPE * np.sqrt(np.maximum(np.abs(square), 1e-12))
    bent = np.where(square >= 0, erf(root * s), erfi(root * s))
    return np.asarray(bent / root * np.sqrt(np.pi) / 2)
