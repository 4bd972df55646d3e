"""Shape contexts: histograms of the other points around each point.

Belongie, Malik and Puzicha (2002): `DISTANCE_BINS` bins whose edges double from `INNER` to `OUTER` times the scale,
the first from 0, by `ANGLE_BINS` equal angles; in space also by `POLAR_BINS` bins of equal solid angle about the z
axis. Distance is the slowest column index, angle the fastest, so that a rotation shifts the last axis of
``histograms.reshape(n, DISTANCE_BINS, -1, ANGLE_BINS)``.

A neighbour is distributed linearly among the nearest bin centres, and fades out beyond the outermost. On deformed
shapes with known pairs this finds more partners by the nearest histogram than sharp bins.

`fit` matches by them: each round compares the shape contexts, assigns pairs at the least total cost with some points
unmatched, and fits a thin-plate spline with less bending ridge than the round before.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.compiled import compiled
from tsis.matching.methods import UNMATCHED, Floats, Integers, MatchFit, assign, require_points
from tsis.matching.spline import spline_basis
from tsis.model.require import require_number

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


DISTANCE_BINS = 5
ANGLE_BINS = 12
POLAR_BINS = 6
INNER, OUTER = 1 / 8, 2.0  # of the scale; four doublings between them give five bins
SMALLEST = 1e-300


def histograms(points: ArrayLike, *, turn: float = 0.0, scale: float | None = None) -> Floats:
    """Shape context of each point (n, d), d = 2 or 3, with directions from the x axis, rotated by ``turn`` towards y.

    The unit ``scale`` of the bins' distances is the mean distance of two points by default. The shape is (n, 60) in the
    plane and (n, 360) in space; a row sums to 1, or to 0 where no point lies within the bins. Raises `InputError` for
    other shapes, or when all points coincide.

    Examples
    --------
    >>> histograms([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]).shape
    (3, 60)
    """
    points = require_points("points", points)
    axis = np.full(len(points), float(turn))
    return _normalised(_counts(points, axis, mean_distance(points) if scale is None else _scale(scale)))


def chi_squared(a: Floats, b: Floats) -> Floats:
    """Chi-squared distances ``sum_k (a_k - b_k)**2 / (a_k + b_k) / 2`` of histograms (n, k) and (m, k), shape (n, m).

    They lie in [0, 1] for histograms that sum to 1.

    Examples
    --------
    >>> chi_squared(np.array([[1.0, 0.0]]), np.array([[1.0, 0.0], [0.0, 1.0]])).tolist()
    [[0.0, 1.0]]
    """
    common = _common(np.ascontiguousarray(a), np.ascontiguousarray(b.T))
    return np.asarray(np.maximum(0.5 * (a.sum(axis=1)[:, None] + b.sum(axis=1)) - 2 * common, 0.0))


def mean_distance(points: Floats) -> float:
    """Mean distance of two of the points, shape (n, d)."""
    return _scale(float(scipy.spatial.distance.pdist(points).mean()) if len(points) > 1 else 0.0)


@compiled
def _common(a: Floats, b: Floats) -> Floats:
    """``sum_k a_k b_k / (a_k + b_k)`` of each pair; b is transposed, shape (k, m)."""
    total = np.zeros((len(a), b.shape[1]))
    for i in range(len(a)):
        for k in range(len(b)):
            x = a[i, k]
            if x > 0:  # most bins are empty
                for j in range(b.shape[1]):
                    total[i, j] += x * b[k, j] / (x + b[k, j])
    return total


@compiled
def _counts(points: Floats, axis: Floats, scale: float) -> Floats:
    """Neighbours in each bin, shape (n, distance, polar, angle); ``axis`` is each point's direction of angle 0."""
    number, dimension = points.shape
    polar = 1 if dimension == 2 else POLAR_BINS
    counts = np.zeros((number, DISTANCE_BINS, polar, ANGLE_BINS))
    for i in range(number):
        for j in range(number):
            x, y = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
            z = 0.0 if dimension == 2 else points[j, 2] - points[i, 2]
            r = np.sqrt(x * x + y * y + z * z)
            if i == j:
                continue
            # Coordinates are in bins, from the centre of the first.
            ring = max(np.log2(max(r / scale, SMALLEST) / INNER) + 0.5, 0.0)
            if ring >= DISTANCE_BINS:
                continue
            angle = ((np.arctan2(y, x) - axis[i]) / (2 * np.pi) * ANGLE_BINS - 0.5) % ANGLE_BINS
            latitude = 0.0 if dimension == 2 or r == 0 else min(max((1 + z / r) / 2 * polar - 0.5, 0.0), polar - 1.0)
            for k in range(int(ring), min(int(ring) + 2, DISTANCE_BINS)):
                near = 1 - abs(ring - k)
                for h in range(int(latitude), min(int(latitude) + 2, polar)):
                    weight = near * (1 - abs(latitude - h))
                    low = int(angle)
                    counts[i, k, h, low % ANGLE_BINS] += weight * (1 - angle + low)
                    counts[i, k, h, (low + 1) % ANGLE_BINS] += weight * (angle - low)
    return counts


def _normalised(counts: Floats) -> Floats:
    flat = counts.reshape(len(counts), -1)
    return np.asarray(flat / np.maximum(flat.sum(axis=1, keepdims=True), SMALLEST))


def _scale(value: float) -> float:
    return require_number("scale", value, SMALLEST, 1e300, hint="the points must not all coincide")


ROUNDS = 6
NO_PARTNER_DISTANCE = 0.25  # chi-squared distance beyond which a pair is rejected,
SPARED = 0.75  # except for this best fraction: the contexts of rotated or noisy points all differ
BENDING = 3.0  # of the first round
SOFTENING = 0.5  # of the bending, from round to round


def fit(source: Floats, target: Floats, /, *, rng: np.random.Generator) -> MatchFit:
    """Match normalised points, shapes (n, d) and (m, d), by their shape contexts; the method is deterministic."""
    del rng
    target_contexts, basis = histograms(target), spline_basis(source)
    transformed = source
    for number in range(ROUNDS):
        cost = chi_squared(histograms(transformed), target_contexts)
        matches = _matches(cost)
        paired = matches != UNMATCHED
        coordinates = basis.coordinates(
            np.where(paired[:, None], target[matches], 0.0),
            bending=BENDING * SOFTENING**number,
            weights=paired.astype(float),
        )
        transformed = basis.design @ coordinates
    correlation = 1 - np.minimum(cost[np.arange(len(source)), matches], 1.0)  # above 1 only by rounding
    return MatchFit(move=basis.spline(coordinates), matches=matches, trust=np.where(paired, correlation, 0.0))


def _matches(cost: Floats) -> Integers:
    """Cheapest pairs of all points of the smaller set, less those beyond the limit of the distance."""
    matches = assign(cost, dummy=np.inf)
    paid = np.where(matches == UNMATCHED, np.inf, cost[np.arange(len(cost)), matches])
    limit = max(NO_PARTNER_DISTANCE, float(np.quantile(paid[np.isfinite(paid)], SPARED)))
    return np.where(paid <= limit, matches, UNMATCHED)
