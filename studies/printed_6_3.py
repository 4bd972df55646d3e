"""What section 6.3 prints of nine inclusions, and how its errors are reckoned."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

PRINTED_RMSE = np.array([1.25, 2.09, 28.65])  # table 6.1
# Table 6.2: estimates of diameter (mm), depth (mm) and modulus (kPa), and their relative errors (%) as printed.
PRINTED = np.array(
    [
        [4.31, 8.2, 77.12],
        [7.38, 7.41, 78.31],
        [9.73, 6.55, 80.35],
        [7.34, 7.17, 82.1],
        [5.52, 8.5, 77.06],
        [5.56, 7.75, 79.92],
        [10.09, 5.88, 89.31],
        [10.07, 5.85, 98.12],
        [10.64, 6.42, 82.97],
    ]
)
PRINTED_ERROR = np.array(
    [
        [115.5, 64.0, 35.73],
        [7.75, 48.2, 34.74],
        [25.15, 31.0, 33.04],
        [4.86, 79.25, 17.89],
        [20.57, 6.25, 22.94],
        [29.43, 35.41, 20.08],
        [0.9, 17.6, 123.28],
        [0.75, 17.0, 40.17],
        [6.41, 28.34, 17.03],
    ]
)
ROUNDING = 0.02  # of a printed error, in per cent


def rmse(estimates: NDArray[np.float64], truth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Root mean square error over the nine inclusions, (6.15), of each parameter."""
    return np.asarray(np.sqrt(np.mean((estimates - truth) ** 2, axis=-2)))


def relative_error(estimates: NDArray[np.float64], truth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Relative error of each estimate, %."""
    return np.asarray(100.0 * np.abs(estimates - truth) / truth)


def without_itself(truth: NDArray[np.float64]) -> NDArray[np.float64]:
    """For each inclusion the mean of the others: what can be said without any press."""
    return np.asarray((truth.sum(axis=0) - truth) / (len(truth) - 1))
