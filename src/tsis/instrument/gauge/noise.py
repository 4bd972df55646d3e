"""How noisy readings are, told from how far they lie off parabolas through their neighbours."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

_SPAN = 4  # successive readings: a parabola has three parameters, the fourth reading is over


def reading_noise(times: NDArray[np.float64], forces: NDArray[np.float64]) -> tuple[float, float]:
    """Standard deviation of independent noise in readings of a smooth course, and its degrees of freedom.

    Of any four successive readings one combination vanishes for every parabola; scaled to length 1 it has the noise's
    standard deviation. Combinations that share readings are correlated, so the degrees of freedom are
    Satterthwaite's for their quadratic form, fewer than there are combinations. A course that bends within four
    readings counts as noise.

    Parameters
    ----------
    times, forces
        At least 4 readings, shape (n,); times ascend.

    Examples
    --------
    >>> times = np.arange(12.0)
    >>> reading_noise(times, 3 * times**2)[0] < 1e-9
    True
    """
    count = len(times) - _SPAN + 1
    rows = np.arange(count)[:, None] + np.arange(_SPAN)
    apart = times[rows][:, :, None] - times[rows][:, None, :]
    apart[:, np.arange(_SPAN), np.arange(_SPAN)] = 1.0
    weights = 1.0 / apart.prod(axis=2)  # of the third divided difference
    weights /= np.linalg.norm(weights, axis=1, keepdims=True)
    combinations = np.zeros((count, len(times)))
    np.put_along_axis(combinations, rows, weights, axis=1)
    gram = combinations @ combinations.T
    freedom = count**2 / float(np.sum(gram**2))
    return float(np.sqrt(np.mean((combinations @ forces) ** 2))), freedom
