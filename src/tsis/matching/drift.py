"""Non-rigid coherent point drift (Myronenko and Song 2010): a Gaussian mixture about the transformed points.

Expectation and maximisation alternate. The displacement field is smooth over a width `WIDTH`, and smoother the larger
`STIFFNESS`. Its Gaussian kernel matrix has low numerical rank, so that a pivoted Cholesky factor replaces it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from tsis.compiled import compiled
from tsis.matching.methods import TOLERANCE_SD, Floats, MatchFit, nearest_pairs, ridge_solution, spacing

WIDTH = 2.0  # beta of the paper, in root-mean-square radii of the points
STIFFNESS = 2.0  # lambda of the paper
OUTLIERS = 0.1  # w of the paper: fraction of unmatched target points
ROUNDS = 150
SETTLED = 0.02  # relative change of the variance that ends the iteration; further rounds fit outliers
SHARPEST = 1e-6  # least variance: positions are no more precise than a thousandth of the points' radius
NEGLIGIBLE = 37.0  # exp(-37) is below rounding of 1
KERNEL_ROUNDING = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DisplacementField:
    """Sum of Gaussians of the width `WIDTH` about control points."""

    control: Floats  # control points, shape (k, d)
    weights: Floats  # their displacements, shape (k, d)

    def __call__(self, points: Floats, /) -> Floats:
        """Transform ``points``, shape (n, d)."""
        return np.asarray(points + gaussian(points, self.control) @ self.weights)


def fit(source: Floats, target: Floats, /, *, rng: np.random.Generator) -> MatchFit:
    """Match normalised points, shapes (n, d) and (m, d), by coherent point drift, which is deterministic."""
    del rng
    move, variance = fit_displacement(source, target)
    tolerance = max(TOLERANCE_SD * np.sqrt(variance), spacing(target) / 2)
    matches, trust = nearest_pairs(move(source), target, tolerance=tolerance)
    return MatchFit(move=move, matches=matches, trust=trust)


def fit_displacement(
    source: Floats, target: Floats, *, outliers: float = OUTLIERS, rounds: int = ROUNDS, settled: float = SETTLED
) -> tuple[DisplacementField, float]:
    """The displacement field between normalised sets (n, d) and (m, d), and the residual variance of positions.

    ``outliers`` is the assumed fraction of unmatched target points, in [0, 1). At most ``rounds`` rounds of expectation
    and maximisation end when the variance changes by less than the fraction ``settled``.
    """
    factor, control, triangle = kernel_factor(source)
    dimension, transformed = source.shape[1], source
    coordinates = np.zeros((factor.shape[1], dimension))
    variance = max(float(scipy.spatial.distance.cdist(source, target, "sqeuclidean").mean() / dimension), SHARPEST)
    for _ in range(rounds):
        counts, explained, drawn = expect(transformed, target, variance, outliers)
        coordinates = _maximise(factor, source, counts, drawn, STIFFNESS * variance)
        transformed = source + factor @ coordinates
        before, variance = variance, _variance(transformed, target, counts, explained, drawn)
        if abs(variance - before) <= settled * before:
            break
    return DisplacementField(
        control=control, weights=scipy.linalg.solve_triangular(triangle, coordinates, lower=True, trans="T")
    ), variance


def gaussian(points: Floats, control: Floats) -> Floats:
    """``exp(-|x - c|**2 / (2 WIDTH**2))`` between two sets of points, shape (n, k)."""
    return np.asarray(np.exp(-scipy.spatial.distance.cdist(points, control, "sqeuclidean") / (2 * WIDTH**2)))


def kernel_factor(points: Floats) -> tuple[Floats, Floats, Floats]:
    """Factor L of the kernel matrix L L', shape (n, k); its k pivot points; and its rows there, shape (k, k)."""
    factor, pivots, rank, _ = scipy.linalg.lapack.dpstrf(gaussian(points, points), tol=KERNEL_ROUNDING, lower=1)
    lower = np.tril(factor)[:, :rank]
    unpivoted = np.empty_like(lower)
    unpivoted[pivots - 1] = lower
    return unpivoted, points[pivots[:rank] - 1], lower[:rank]


def _maximise(factor: Floats, source: Floats, counts: Floats, drawn: Floats, ridge: float) -> Floats:
    """Coordinates c of the displacement L c, by ridge regression on the weighted targets."""
    normal = factor.T @ (counts[:, None] * factor)
    right = factor.T @ (drawn - counts[:, None] * source)
    return ridge_solution(normal, right, ridge)


def _variance(transformed: Floats, target: Floats, counts: Floats, explained: Floats, drawn: Floats) -> float:
    """Mean square distance per coordinate of target points from their source points."""
    total = explained @ np.sum(target**2, axis=1) + counts @ np.sum(transformed**2, axis=1)
    total -= 2 * np.sum(transformed * drawn)
    return max(float(total / max(counts.sum() * transformed.shape[1], 1e-300)), SHARPEST)


def expect(transformed: Floats, target: Floats, variance: float, outliers: float) -> tuple[Floats, Floats, Floats]:
    """The sums of `expected_sums` where the fraction ``outliers`` of the target is spread evenly."""
    n, dimension = transformed.shape
    background = (2 * np.pi * variance) ** (dimension / 2) * outliers / (1 - outliers) * n / len(target)
    return expected_sums(transformed, target, variance, np.zeros(n), background)


@compiled
def expected_sums(
    transformed: Floats, target: Floats, variance: float, handicap: Floats, background: float
) -> tuple[Floats, Floats, Floats]:
    """Sums of the probabilities that target j belongs to source i, without the matrix or its entries below rounding.

    They are the sum over the target, shape (n,), that over the source, shape (m,), and the sum of the target's points
    weighted by them, shape (n, d). A source point's weight is ``exp(-handicap - |x - y|**2 / (2 variance))``, with
    ``handicap`` of shape (n,); that of no source point is ``background``.
    """
    n, dimension = transformed.shape
    m = len(target)
    counts, explained, drawn = np.zeros(n), np.zeros(m), np.zeros((n, dimension))
    away, chance = np.empty(n), np.empty(n)
    for j in range(m):
        for i in range(n):
            square = 0.0
            for k in range(dimension):
                square += (target[j, k] - transformed[i, k]) ** 2
            away[i] = square / (2 * variance) + handicap[i]
        nearest = away.min()  # an offset against underflow
        total = background * np.exp(nearest) if background > 0 else 0.0
        for i in range(n):
            chance[i] = np.exp(nearest - away[i]) if away[i] - nearest < NEGLIGIBLE else 0.0
            total += chance[i]
        for i in range(n):
            if chance[i] > 0:
                share = chance[i] / total
                counts[i] += share
                explained[j] += share
                for k in range(dimension):
                    drawn[i, k] += share * target[j, k]
    return counts, explained, drawn
