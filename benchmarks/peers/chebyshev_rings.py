"""The polynomials of a surrogate evaluated by NumPy's own Chebyshev series."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import chebyshev

from tsis.mechanics.surrogate.polynomial import contrast_factor, signal_scale

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from tsis.mechanics.surrogate.polynomial import TissueSurrogate

AT_ONCE = 2000  # inclusions, so that what lies between fits into memory


def rings_by_numpy(
    rings: TissueSurrogate,
) -> Callable[[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]:
    """The call that answers for diameters, depths and moduli, each of shape (n,); the answer has shape (n, outputs)."""
    series = rings.change
    for axis in range(3):
        series = _coefficients(series, axis)
    box = rings.box

    def answered(
        diameter_mm: NDArray[np.float64], depth_mm: NDArray[np.float64], young_kpa: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        factor = contrast_factor(young_kpa / rings.tissue_young_kpa)
        places = (
            _unit(box.diameter_mm, diameter_mm),
            _unit(box.depth_mm, depth_mm),
            _unit(box.contrast_factor, factor),
        )
        found = np.empty((len(diameter_mm), series.shape[-1]))
        for start in range(0, len(found), AT_ONCE):
            x, y, z = (place[start : start + AT_ONCE] for place in places)
            found[start : start + AT_ONCE] = chebyshev.chebval3d(x, y, z, series).T
        return np.asarray(found * signal_scale(diameter_mm, depth_mm, factor)[:, None] + rings.baseline)

    return answered


def _coefficients(values: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
    """Chebyshev coefficients along an axis, from values at the points of the first kind."""
    count = values.shape[axis]
    terms = chebyshev.chebvander(-np.cos(np.pi * (np.arange(count) + 0.5) / count), count - 1)
    front = np.moveaxis(values, axis, 0)
    found = np.linalg.solve(np.asarray(terms, dtype=float), front.reshape(count, -1)).reshape(front.shape)
    return np.moveaxis(found, 0, axis)


def _unit(interval: tuple[float, float], values: NDArray[np.float64]) -> NDArray[np.float64]:
    low, high = interval
    return (2 * values - low - high) / (high - low)
