"""Evidence for a map between two point sets, by which maps that began differently are compared."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.optics.compiled import fused

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.matching.spline import SplineBasis

BENT = 0.01  # prior variance of a bending coordinate, of normalised points
NARROWEST = 1e-3  # standard deviation of a pair, of normalised points
UPRIGHT = 20.0  # log odds of sets the same way up against those turned by half a turn, before they are seen
ROUNDS = 12
FEWEST_OUTLIERS, MOST_OUTLIERS = 0.01, 0.95


def log_evidence(basis: SplineBasis, coordinates: NDArray[np.float64], target: NDArray[np.float64]) -> float:
    """Log probability of the target, over that of points spread evenly, when the moved source explains it.

    Each target point is an outlier anywhere in the target's box, or lies about a moved source point; the outliers'
    share and the common standard deviation are those that explain the target best. The bending coordinates are normal
    with variance `BENT` before the data are seen, and integrated over by Laplace's method. Sets are likelier the same
    way up than turned (`UPRIGHT`), which decides only where the points themselves hardly do.

    Parameters
    ----------
    basis, coordinates
        The spline, at the source's points.
    target
        Shape (m, d).
    """
    count, dimension = target.shape
    box = float(np.prod(np.ptp(target, axis=0)))
    moved = basis.design @ coordinates
    outliers, variance = 0.1, 0.05**2
    for _ in range(ROUNDS):
        likelihood, paired, squared = _explained(moved, target, variance, outliers, 1 / box)
        total = paired.sum()
        outliers = float(np.clip(1 - total / count, FEWEST_OUTLIERS, MOST_OUTLIERS))
        variance = max(squared / (dimension * max(total, 1e-9)), NARROWEST**2)
    likelihood, paired, _ = _explained(moved, target, variance, outliers, 1 / box)
    bends = basis.design[:, : basis.bent]
    precision = (bends * paired[:, None]).T @ bends * (BENT / variance)
    precision[np.diag_indices_from(precision)] += 1
    _, volume = np.linalg.slogdet(precision)
    bending = float((coordinates[: basis.bent] ** 2).sum()) / BENT
    turned = UPRIGHT * (1 - _cosine_of_turn(coordinates[basis.bent + 1 :])) / 2
    return float(likelihood + count * np.log(box) - 0.5 * bending - 0.5 * dimension * volume - turned)


def _cosine_of_turn(matrix: NDArray[np.float64]) -> float:
    """Cosine of the angle of the rotation that is nearest to a matrix, shape (d, d)."""
    left, _, right = np.linalg.svd(matrix)
    trace = float(np.trace(left @ right))
    return float(np.clip(trace / 2 if len(matrix) == 2 else (trace - 1) / 2, -1.0, 1.0))


@fused
def _explained(
    moved: NDArray[np.float64], target: NDArray[np.float64], variance: float, outliers: float, even: float
) -> tuple[float, NDArray[np.float64], float]:
    """Log likelihood, sum of each source point's responsibilities, and the squared distances weighed by them."""
    n, dimension = moved.shape
    near = (1 - outliers) / n * (2 * np.pi * variance) ** (-dimension / 2)
    paired, weights, away = np.zeros(n), np.empty(n), np.empty(n)
    likelihood, squared = 0.0, 0.0
    for j in range(len(target)):
        total = outliers * even
        for i in range(n):
            away[i] = 0.0
            for axis in range(dimension):
                away[i] += (moved[i, axis] - target[j, axis]) ** 2
            weights[i] = near * np.exp(-0.5 * away[i] / variance) if away[i] < 50 * variance else 0.0
            total += weights[i]
        likelihood += np.log(total)
        for i in range(n):
            if weights[i] > 0:
                paired[i] += weights[i] / total
                squared += weights[i] / total * away[i]
    return likelihood, paired, squared
