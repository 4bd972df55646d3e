"""Relaxation labelling that preserves topology: neighbours of partners support each other.

The source states the problem as the maximum of the energy (5.6) under (5.7), whose two constraints are printed swapped.
A pair (i, j) is supported by pairs (a, b) of neighbours a of i and b of j whose positions relative to i and j agree:
``r = alpha * beta * gamma`` (5.11), with alpha for their distances (5.8), beta for their directions (5.9) and gamma for
the nearness of a (5.10). Their sum is the support (5.12); the update is (5.13), then rows and columns are normalised.
The source bins distances (5) and angles (12); alpha and beta here use the exact values. The printed beta ignores that
angles are circular, and the printed sums run over all points instead of neighbours.

Each source point has `CANDIDATES` targets; the supports between candidates are a sparse matrix.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree

from tsis.compiled import fused

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.matching._fit import Floats, Integers


NEIGHBOURS = 10  # of a source point
TARGET_NEIGHBOURS = 14  # more than of a source point, to allow for outliers
CANDIDATES = 20
UPDATES = 30
SETTLED = 1e-3
NOTHING = 1e-6  # smaller probabilities are set to zero
NORMALISATIONS = 3  # of rows and columns after each update
SHARPNESS = 0.05  # cost that reduces an initial probability by 1/e
FARTHEST = 1.25  # distance at which gamma vanishes, of the farthest neighbour's
SAME_DISTANCE = 1.0  # difference of the logarithms of two distances at which alpha vanishes


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Neighbourhood:
    """The nearest neighbours of each point: index, distance and direction."""

    index: Integers  # shape (n, k), nearest first
    log_distance: Floats  # logarithm of their distance, shape (n, k)
    direction: Floats  # unit vector towards them, shape (n, k, d)

    @classmethod
    def of(cls, points: Floats, count: int) -> Neighbourhood:
        """Neighbours of points, shape (n, d)."""
        _, index = KDTree(points).query(points, k=min(count + 1, len(points)))
        return cls.among(points, np.asarray(index)[:, 1:])

    @classmethod
    def among(cls, points: Floats, index: Integers) -> Neighbourhood:
        """Neighbourhood of points, shape (n, d), with the neighbours ``index``."""
        away = points[index] - points[:, None, :]
        distance = np.maximum(np.linalg.norm(away, axis=2), 1e-12)
        return cls(index=index, log_distance=np.log(distance), direction=away / distance[..., None])

    @property
    def nearness(self) -> Floats:
        """Gamma of each neighbour (5.10), summing to one over those of a point, shape (n, k)."""
        distance = np.exp(self.log_distance)
        gamma = 1 - distance / (FARTHEST * distance.max(axis=1, keepdims=True))
        return np.asarray(gamma / gamma.sum(axis=1, keepdims=True))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Labels:
    """Probabilities of partners."""

    candidates: Integers  # candidate target points, shape (n, c)
    # Their probabilities, shape (n, c); a row sums to one together with the probability of no partner
    probability: Floats

    @property
    def best(self) -> Integers:
        """The likeliest target point, shape (n,)."""
        rows = np.arange(len(self.candidates))
        return np.asarray(self.candidates[rows, self.probability.argmax(axis=1)])

    @property
    def trust(self) -> Floats:
        """Probability of the likeliest, shape (n,)."""
        return np.asarray(self.probability.max(axis=1))


def label(
    source: Neighbourhood, target: Neighbourhood, cost: Floats, *, single: float, updates: int = UPDATES
) -> Labels:
    """Probabilities of partners after relaxation, from the initial ``cost`` of each pair, shape (n, m).

    ``single`` is the support for having no partner, in (0, 1], where full agreement of all neighbours is 1.
    """
    candidates = cheapest(cost, CANDIDATES)
    costs = np.take_along_axis(cost, candidates, axis=1)
    probability = np.exp((costs.min(axis=1, keepdims=True) - costs) / SHARPNESS)
    none = 1 / (candidates.shape[1] + 1)
    probability *= (1 - none) / probability.sum(axis=1, keepdims=True)
    slot = np.full(cost.shape, -1, dtype=np.int16)
    np.put_along_axis(slot, candidates, np.arange(candidates.shape[1], dtype=np.int16)[None, :], axis=1)
    supports = _supports(
        candidates,
        slot,
        source.index,
        target.index,
        source.log_distance,
        target.log_distance,
        source.direction,
        target.direction,
        source.nearness,
        SAME_DISTANCE,
    )
    _relax(probability, np.full(len(cost), none), candidates, *supports, single, cost.shape[1], updates)
    return Labels(candidates=candidates, probability=probability)


def cheapest(cost: Floats, count: int) -> Integers:
    """The ``count`` cheapest columns of each row at most, in no order."""
    if count >= cost.shape[1]:
        return np.tile(np.arange(cost.shape[1]), (len(cost), 1))
    return np.asarray(np.argpartition(cost, count - 1, axis=1)[:, :count])


@fused
def _supports(
    candidates: Integers,
    slot: NDArray[np.int16],
    source_index: Integers,
    target_index: Integers,
    source_log: Floats,
    target_log: Floats,
    source_direction: Floats,
    target_direction: Floats,
    nearness: Floats,
    same: float,
) -> tuple[Integers, NDArray[np.int32], NDArray[np.float32]]:
    """Sparse matrix of the support between entries of the flattened probabilities.

    The weight is the compatibility (5.11): alpha (5.8) times beta (5.9) times gamma (5.10).
    """
    n, c = candidates.shape
    dimension = source_direction.shape[2]
    start = np.zeros(n * c + 1, dtype=np.int64)
    entry = np.empty(8 * n * c, dtype=np.int32)
    weight = np.empty(len(entry), dtype=np.float32)
    count = 0
    for i in range(n):
        for s in range(c):
            j = candidates[i, s]
            for a in range(source_index.shape[1]):
                for b in range(target_index.shape[1]):
                    position = slot[source_index[i, a], target_index[j, b]]
                    if position < 0:
                        continue
                    alpha = 1 - abs(source_log[i, a] - target_log[j, b]) / same
                    beta = 0.0
                    for axis in range(dimension):
                        beta += source_direction[i, a, axis] * target_direction[j, b, axis]
                    if alpha <= 0 or beta <= 0:
                        continue
                    if count == len(entry):
                        entry = np.append(entry, np.empty(count, dtype=np.int32))
                        weight = np.append(weight, np.empty(count, dtype=np.float32))
                    entry[count], weight[count] = source_index[i, a] * c + position, alpha * beta * nearness[i, a]
                    count += 1
            start[i * c + s + 1] = count
    return start, entry[:count], weight[:count]


@fused
def _relax(
    probability: Floats,
    none: Floats,
    candidates: Integers,
    start: Integers,
    entry: NDArray[np.int32],
    weight: NDArray[np.float32],
    single: float,
    columns: int,
    updates: int,
) -> None:
    """Iterate in place: sum the support (5.12), update by (5.13), normalise rows to one and columns to at most one."""
    n, c = probability.shape
    flat = probability.reshape(-1)
    support = np.empty(n * c)
    for _ in range(updates):
        for at in range(n * c):
            total = 0.0
            for k in range(start[at], start[at + 1]):
                total += weight[k] * flat[entry[k]]
            support[at] = total
        before = flat.copy()
        flat *= support
        none *= single
        for _ in range(NORMALISATIONS):
            _normalise_rows(probability, none)
            taken = np.zeros(columns)
            for i in range(n):
                for s in range(c):
                    taken[candidates[i, s]] += probability[i, s]
            for i in range(n):
                for s in range(c):
                    if taken[candidates[i, s]] > 1:
                        probability[i, s] /= taken[candidates[i, s]]
        for i in range(n):
            none[i] = max(1 - probability[i].sum(), 0.0)  # the rest after normalising the columns
        change = 0.0
        for at in range(n * c):
            if flat[at] < NOTHING:
                flat[at] = 0.0
            change = max(change, abs(flat[at] - before[at]))
        if change < SETTLED:
            break


@fused
def _normalise_rows(probability: Floats, none: Floats) -> None:
    for i in range(len(none)):
        total = none[i] + probability[i].sum()
        none[i] /= total
        probability[i] /= total


def reference_supports(source: Neighbourhood, target: Neighbourhood) -> Floats:
    """Support ``[i, j, a, b]`` of pair (i, j) by pair (a, b), shape (n, m, n, m): the terms of (5.12) in full."""
    difference = np.abs(source.log_distance[:, None, :, None] - target.log_distance[None, :, None, :])
    alpha = np.maximum(1 - difference / SAME_DISTANCE, 0)
    beta = np.maximum(np.einsum("iad,jbd->ijab", source.direction, target.direction), 0)
    n, m = len(source.index), len(target.index)
    i, j = np.arange(n)[:, None, None, None], np.arange(m)[None, :, None, None]
    supports = np.zeros((n, m, n, m))
    supports[i, j, source.index[:, None, :, None], target.index[None, :, None, :]] = (
        alpha * beta * source.nearness[:, None, :, None]
    )
    return supports


def reference_label(
    source: Neighbourhood, target: Neighbourhood, cost: Floats, *, single: float, updates: int = UPDATES
) -> Floats:
    """The probabilities of `label` as a full matrix, shape (n, m), from products of full matrices."""
    supports, candidates = reference_supports(source, target), cheapest(cost, CANDIDATES)
    allowed = np.zeros(cost.shape)
    none = np.full((len(cost), 1), 1 / (candidates.shape[1] + 1))
    np.put_along_axis(allowed, candidates, 1.0, axis=1)
    probability = allowed * np.exp((cost.min(axis=1, keepdims=True) - cost) / SHARPNESS)
    probability *= (1 - none) / probability.sum(axis=1, keepdims=True)
    for _ in range(updates):
        before = probability
        probability, none = probability * np.tensordot(supports, probability, axes=2), none * single
        for _ in range(NORMALISATIONS):
            total = none + probability.sum(axis=1, keepdims=True)
            probability, none = probability / total, none / total
            probability = probability / np.maximum(probability.sum(axis=0), 1)
        none = np.maximum(1 - probability.sum(axis=1, keepdims=True), 0)
        probability[probability < NOTHING] = 0
        if np.max(np.abs(probability - before)) < SETTLED:
            break
    return np.asarray(probability)
