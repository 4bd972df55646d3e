"""Evidence of a map between two point sets, to compare maps from different starts, and maps with no relation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree

from tsis.compiled import fused
from tsis.matching._fit import Floats, ridge_solution

if TYPE_CHECKING:
    from tsis.matching._spline import SplineBasis


BENDING_VARIANCES = (1e-4, 1e-3, 1e-2)  # priors of a bending coordinate of normalised points; the likeliest counts
FIRST_OUTLIERS = 0.1
NARROWEST = 1e-3  # least standard deviation of a pair, of normalised points
ROUNDS = 6
CUT_OFF_VARIANCES = 50.0  # variances: squared distance beyond which the likelihood is neglected
FEWEST_OUTLIERS, MOST_OUTLIERS = 0.01, 0.95
UPRIGHT = 0.2  # log odds per target point of upright sets against sets rotated by 180 degrees; a true pose gains more
SLACK = 1e-6  # ridge on the affine part, which regularises zero responsibility


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ExplainedTarget:
    """Likelihood of the target under the transformed source points, and sums over the responsibilities."""

    likelihood: float  # log of the target's probability
    paired: Floats  # sum of each source point's responsibilities, shape (n,)
    drawn: Floats  # weighted sum of the targets, shape (n, d)
    squared: float  # weighted sum of the squared distances


def log_evidence(basis: SplineBasis, coordinates: Floats, target: Floats) -> float:
    """Log probability of the target (m, d) given the transformed source, over that of uniformly distributed points.

    Each target point is an outlier, uniform in the target's box, or is normal about a transformed source point. Spline,
    outlier fraction and common standard deviation maximise the likelihood near the given spline. The bending
    coordinates have a normal prior and are integrated out by Laplace's method.
    """
    return max(_evidence(basis, coordinates, target, bending_variance) for bending_variance in BENDING_VARIANCES)


def upright_prior(matrix: Floats, points: int) -> float:
    """Log prior of a pose's matrix, shape (d, d), for a target of ``points`` points; 0 without rotation.

    Upright sets are likelier than rotated ones. That decides between poses of nearly equal evidence.
    """
    return UPRIGHT * points * (_cosine_of_rotation(matrix) - 1) / 2


def _evidence(basis: SplineBasis, coordinates: Floats, target: Floats, bending_variance: float) -> float:
    count, dimension = target.shape
    box = float(np.prod(np.ptp(target, axis=0)))
    nearest, _ = KDTree(target).query(basis.design @ coordinates)
    outliers, variance = FIRST_OUTLIERS, max(float(np.mean(nearest**2)) / dimension, NARROWEST**2)
    for _ in range(ROUNDS):
        now = explained(basis.design @ coordinates, target, variance, outliers, 1 / box)
        total = max(float(now.paired.sum()), 1e-9)
        outliers = float(np.clip(1 - total / count, FEWEST_OUTLIERS, MOST_OUTLIERS))
        variance = max(now.squared / (dimension * total), NARROWEST**2)
        coordinates = _fit_spline(basis, now, variance / bending_variance)
    now = explained(basis.design @ coordinates, target, variance, outliers, 1 / box)
    bends = basis.design[:, : basis.bent]
    precision = (bends * now.paired[:, None]).T @ bends * (bending_variance / variance)
    precision[np.diag_indices_from(precision)] += 1
    _, volume = np.linalg.slogdet(precision)
    bending = float((coordinates[: basis.bent] ** 2).sum()) / bending_variance
    return float(now.likelihood + count * np.log(box) - 0.5 * bending - 0.5 * dimension * volume)


def _fit_spline(basis: SplineBasis, now: ExplainedTarget, bending: float) -> Floats:
    normal = basis.design.T @ (now.paired[:, None] * basis.design)
    right = basis.design.T @ now.drawn
    ridge = np.full(len(normal), bending)
    ridge[basis.bent :] = SLACK
    right[basis.bent :] += SLACK * basis.rest[basis.bent :]
    return ridge_solution(normal, right, ridge)


def _cosine_of_rotation(matrix: Floats) -> float:
    """Cosine of the angle of the nearest rotation to a matrix, shape (d, d)."""
    left, _, right = np.linalg.svd(matrix)
    trace = float(np.trace(left @ right))
    return float(np.clip(trace / 2 if len(matrix) == 2 else (trace - 1) / 2, -1.0, 1.0))


def explained(transformed: Floats, target: Floats, variance: float, outliers: float, even: float) -> ExplainedTarget:
    """Likelihood of the target, shape (m, d), under the transformed source points, shape (n, d).

    The fraction ``outliers`` of the targets has the uniform density ``even``; the others are normal with ``variance``
    about any of the source points with equal probability.
    """
    order = np.argsort(transformed[:, 0], kind="stable")
    likelihood, inner, outer, squared = _explained(transformed[order], target, variance, outliers, even)
    paired, drawn = np.empty_like(inner), np.empty_like(outer)
    paired[order], drawn[order] = inner, outer
    return ExplainedTarget(likelihood=likelihood, paired=paired, drawn=drawn, squared=squared)


@fused
def _explained(
    transformed: Floats, target: Floats, variance: float, outliers: float, even: float
) -> tuple[float, Floats, Floats, float]:
    """Kernel of `explained`; transformed points ascend along the first axis, so that near ones are contiguous."""
    n, dimension = transformed.shape
    near = (1 - outliers) / n * (2 * np.pi * variance) ** (-dimension / 2)
    paired, drawn, weights, away = np.zeros(n), np.zeros((n, dimension)), np.empty(n), np.empty(n)
    likelihood, squared = 0.0, 0.0
    extent = np.sqrt(CUT_OFF_VARIANCES * variance)
    first_axis = np.ascontiguousarray(transformed[:, 0])
    for j in range(len(target)):
        total = outliers * even
        first = np.searchsorted(first_axis, target[j, 0] - extent)
        last = np.searchsorted(first_axis, target[j, 0] + extent)
        for i in range(first, last):
            away[i] = 0.0
            for axis in range(dimension):
                away[i] += (transformed[i, axis] - target[j, axis]) ** 2
            weights[i] = near * np.exp(-0.5 * away[i] / variance) if away[i] < CUT_OFF_VARIANCES * variance else 0.0
            total += weights[i]
        likelihood += np.log(total)
        for i in range(first, last):
            if weights[i] > 0:
                fraction = weights[i] / total
                paired[i] += fraction
                squared += fraction * away[i]
                for axis in range(dimension):
                    drawn[i, axis] += fraction * target[j, axis]
    return likelihood, paired, drawn, squared
