"""Bayesian coherent point drift: a similarity after a smooth displacement, by variational Bayes.

Source: Hirose 2021, doi:10.1109/TPAMI.2020.2971687, written from the paper. Each target point comes from a displaced
source point, all equally often (an infinite kappa of the paper), or is an outlier, spread evenly over the target's box.
The displacement has a Gaussian-process prior; its posterior variance at each point blurs that point. The paper takes
the fraction of outliers as known. Here several are tried where it is not, and the variational bound chooses.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from tsis.matching.drift import SHARPEST, DisplacementField, expected_sums, kernel_factor
from tsis.matching.methods import TOLERANCE_SD, Floats, MatchFit, nearest_pairs, spacing

STIFFNESS = 2.0  # lambda of the paper; the width of the kernel is that of `tsis.matching.drift`
WIDENING = 0.3  # gamma of the paper: first variance, of the mean square distance between the sets
FRACTIONS = (0.1, 0.4, 0.7)  # of outliers in the target, that are tried
ROUNDS = 500
SETTLED = 1e-3  # relative change of the variance that ends the iteration
ROOM = 1.1  # extent of the outliers' box, of the target's


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SimilarityField:
    """A displacement field, then a similarity: ``scale * rotation @ (y + v(y)) + shift``."""

    scale: float
    rotation: Floats  # shape (d, d)
    shift: Floats  # shape (d,)
    displacement: DisplacementField

    def __call__(self, points: Floats, /) -> Floats:
        """Transform ``points``, shape (n, d)."""
        return np.asarray(self.scale * self.displacement(points) @ self.rotation.T + self.shift)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DriftFit:
    """The map, the residual variance of positions, and how well both explain the target."""

    move: SimilarityField
    variance: float
    outliers: float  # expected fraction of target points that are outliers
    bound: float  # variational lower bound of the target's log probability


def fit(source: Floats, target: Floats, /, *, rng: np.random.Generator) -> MatchFit:
    """Match normalised points, shapes (n, d) and (m, d), by Bayesian coherent point drift, which is deterministic."""
    del rng
    drift = max((fit_drift(source, target, outliers=item) for item in FRACTIONS), key=lambda item: item.bound)
    tolerance = max(TOLERANCE_SD * np.sqrt(drift.variance), spacing(target) / 2)
    matches, trust = nearest_pairs(drift.move(source), target, tolerance=tolerance)
    return MatchFit(move=drift.move, matches=matches, trust=trust)


def fit_drift(
    source: Floats,
    target: Floats,
    *,
    outliers: float,
    stiffness: float = STIFFNESS,
    rounds: int = ROUNDS,
    settled: float = SETTLED,
) -> DriftFit:
    """Fit normalised sets, shapes (n, d) and (m, d), in at most ``rounds`` rounds.

    ``outliers``, in [0, 1), is the probability that a target point has no source point. ``stiffness``, positive, keeps
    the displacements small. The rounds end when the variance changes by less than the fraction ``settled``.
    """
    n, dimension = source.shape
    factor, control, triangle = kernel_factor(source)
    blur, transformed = np.ones(n) / stiffness, source
    scale, rotation, shift = 1.0, np.eye(dimension), np.zeros(dimension)
    density = 1 / max(float(np.prod(ROOM * np.ptp(target, axis=0))), SHARPEST)
    variance = max(
        WIDENING * float(scipy.spatial.distance.cdist(source, target, "sqeuclidean").mean() / dimension), SHARPEST
    )
    coordinates, divergence = np.zeros((factor.shape[1], dimension)), 0.0
    sized = False  # an evenly filled set would shrink to a point under the first, wide variance
    for _ in range(rounds):
        handicap = scale**2 * dimension * blur / (2 * variance) + np.log(n)
        background = (2 * np.pi * variance) ** (dimension / 2) * density * outliers / (1 - outliers)
        counts, explained, drawn = expected_sums(transformed, target, variance, handicap, background)
        precision = counts * scale**2 / variance
        pull = scale / variance * (drawn - counts[:, None] * shift) @ rotation - precision[:, None] * source
        coordinates, blur, divergence = _displacement(factor, precision, pull, stiffness)
        displaced = source + factor @ coordinates
        scale, rotation, shift, mean_blur = _similarity(counts, drawn, displaced, blur, sized=sized)
        transformed = scale * displaced @ rotation.T + shift
        residual = explained @ np.sum(target**2, axis=1) + counts @ np.sum(transformed**2, axis=1)
        residual = (residual - 2 * np.sum(transformed * drawn)) / max(dimension * float(counts.sum()), 1e-300)
        before, variance = variance, max(residual + scale**2 * mean_blur, SHARPEST)
        if abs(variance - before) <= settled * before:
            if sized:
                break
            sized = True
    weights = scipy.linalg.solve_triangular(triangle, coordinates, lower=True, trans="T")
    displacement = DisplacementField(control=control, weights=weights)
    away = scipy.spatial.distance.cdist(target, transformed, "sqeuclidean") + scale**2 * dimension * blur
    inlier = scipy.special.logsumexp(-away / (2 * variance), axis=1) + np.log((1 - outliers) / n)
    inlier -= dimension / 2 * np.log(2 * np.pi * variance)
    either = np.logaddexp(inlier, np.log(max(outliers, 1e-300) * density))
    return DriftFit(
        move=SimilarityField(scale=scale, rotation=rotation, shift=shift, displacement=displacement),
        variance=variance,
        outliers=float(1 - np.exp(inlier - either).mean()),
        bound=float(either.sum()) - divergence,
    )


def _displacement(factor: Floats, precision: Floats, pull: Floats, stiffness: float) -> tuple[Floats, Floats, float]:
    """Posterior of the displacement L c, L the kernel's factor, of shape (n, k): c, its variances, its divergence.

    ``precision``, shape (n,), weighs the points; ``pull``, shape (n, d), is their weighted displacement. The variance
    at each point has shape (n,). The divergence from the prior is that of Kullback and Leibler.
    """
    inner = factor.T @ (precision[:, None] * factor)
    inner[np.diag_indices_from(inner)] += stiffness
    lower = np.linalg.cholesky(inner)
    half = scipy.linalg.solve_triangular(lower, factor.T, lower=True)
    coordinates = scipy.linalg.solve_triangular(lower, half @ pull, lower=True, trans="T")
    rank, dimension = coordinates.shape
    inverse = scipy.linalg.solve_triangular(lower, np.eye(rank), lower=True)
    divergence = dimension * (stiffness * np.sum(inverse**2) - rank - rank * np.log(stiffness)) / 2
    divergence += dimension * np.log(np.diag(lower)).sum() + stiffness * np.sum(coordinates**2) / 2
    return coordinates, np.einsum("kn,kn->n", half, half), float(divergence)


def _similarity(
    counts: Floats, drawn: Floats, displaced: Floats, blur: Floats, *, sized: bool
) -> tuple[float, Floats, Floats, float]:
    """Scale, rotation and shift of displaced points (n, d) to their expected targets, and their mean variance.

    The scale is 1 until ``sized``.
    """
    matched = max(float(counts.sum()), 1e-300)
    mean_blur = float(counts @ blur / matched)
    there, here = drawn.sum(axis=0) / matched, counts @ displaced / matched
    centred = displaced - here
    left, values, right = np.linalg.svd((drawn - np.outer(counts, there)).T @ centred / matched)
    signs = np.ones(len(values))
    signs[-1] = 1.0 if np.linalg.det(left @ right) > 0 else -1.0
    rotation = (left * signs) @ right
    spread = float(counts @ np.sum(centred**2, axis=1) / matched) + len(values) * mean_blur
    scale = max(float(values @ signs) / max(spread, 1e-300), 1e-3) if sized else 1.0
    return scale, rotation, there - scale * rotation @ here, mean_blur
