"""Relaxation labelling that preserves topology: neighbours of partners support each other.

The source states the problem as the maximum of the energy (5.6) under (5.7), whose two constraints are printed swapped.
A pair (i, j) is supported by pairs (a, b) of neighbours a of i and b of j whose positions relative to i and j agree:
``r = alpha * beta * gamma`` (5.11), with alpha for their distances (5.8), beta for their directions (5.9) and gamma for
the nearness of a (5.10). Their sum is the support (5.12); the update is (5.13), then rows and columns are normalised.
The source bins distances (5) and angles (12); alpha and beta here use the exact values. The printed beta ignores that
angles are circular, and the printed sums run over all points instead of neighbours.

For trial rotations, shape contexts and labels propose pairs, whose consensus is a pose. The printed method measures
angles from the direction to the mass centre, which outliers and missing parts rotate; that causes most of its failures.
Here the whole source is rotated by a grid of rotations, dense enough for the shape contexts, and the pose is the affine
map that the most trusted pairs agree on.

Each source point has `CANDIDATES` targets; the supports between candidates are a sparse matrix.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.compiled import fused
from tsis.matching.shape_context import ANGLE_BINS, chi_squared, histograms, mean_distance
from tsis.matching.spline import spread_indices

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.matching.methods import Floats, Integers


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
        _, index = scipy.spatial.KDTree(points).query(points, k=min(count + 1, len(points)))
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
    near = np.empty(target_index.shape[1], dtype=np.int64)
    for i in range(n):
        for s in range(c):
            j = candidates[i, s]
            for a in range(source_index.shape[1]):
                among, number = slot[source_index[i, a]], 0
                for b in range(target_index.shape[1]):
                    near[number] = b  # overwritten unless it is a candidate
                    number += among[target_index[j, b]] >= 0
                for b in near[:number]:
                    position = among[target_index[j, b]]
                    alpha = 1 - abs(source_log[i, a] - target_log[j, b]) / same  # (5.8)
                    beta = 0.0  # (5.9)
                    for axis in range(dimension):
                        beta += source_direction[i, a, axis] * target_direction[j, b, axis]
                    if alpha <= 0 or beta <= 0:
                        continue
                    if count == len(entry):
                        entry = np.append(entry, np.empty(count, dtype=np.int32))
                        weight = np.append(weight, np.empty(count, dtype=np.float32))
                    entry[count] = source_index[i, a] * c + position
                    weight[count] = alpha * beta * nearness[i, a]  # (5.11)
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
            if flat[at] > 0:  # zero stays zero; the sum is (5.12)
                for k in range(start[at], start[at + 1]):
                    total += weight[k] * flat[entry[k]]
            support[at] = total
        before = flat.copy()
        flat *= support  # (5.13)
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


NO_PARTNER_SUPPORT = 0.07  # support for having no partner
POSE_UPDATES = 20
COMPARED = 150  # source points whose shape contexts choose the rotations
LABELLED = {2: 6, 3: 30}  # rotations that are labelled, by dimension
MANY, LABELLED_OF_MANY = 200_000, 2  # number of pairs beyond which fewer rotations are labelled
CLEAR = 0.65  # agreement that ends the search
DRAWS = 250  # random samples of d + 1 pairs
CLOSE = 0.25  # root-mean-square radii: a pair farther from an affine map does not agree with it
LEAST_VOLUME, MOST_VOLUME = 0.1, 6.0  # factor of areas or volumes under a pose
MOST_SHEAR = 1.6  # mean squared singular value over their squared geometric mean; 1 for a similarity
LEAST_SPREAD = 0.1  # area or volume of the drawn points


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pose:
    """An affine map, shape (d + 1, d) with the translation in row 0, and the weight of the pairs that agree on it."""

    affine: Floats
    agreement: float


def poses(source: Floats, target: Floats, *, rng: np.random.Generator) -> list[Pose]:
    """Poses of the source on the target by falling agreement; normalised points, shapes (n, d) and (m, d)."""
    scale = mean_distance(target)
    contexts = histograms(target, scale=scale)
    likely = _likely_rotations(source, contexts, scale)
    about = Neighbourhood.of(target, TARGET_NEIGHBOURS)
    here = Neighbourhood.of(source, NEIGHBOURS)
    poses: list[Pose] = []
    for rotation in likely[: LABELLED[source.shape[1]] if len(source) * len(target) < MANY else LABELLED_OF_MANY]:
        cost = chi_squared(histograms(source @ rotation.T, scale=scale), contexts)
        around = Neighbourhood.among(source @ rotation.T, here.index)
        labels = label(around, about, cost, single=NO_PARTNER_SUPPORT, updates=POSE_UPDATES)
        pose = agreed(source, target[labels.best], labels.trust**2, rng=rng)
        poses.append(Pose(affine=pose.affine, agreement=pose.agreement * float(labels.trust.mean())))
        if poses[-1].agreement > CLEAR:
            break
    return sorted(poses, key=lambda pose: -pose.agreement)


def _likely_rotations(source: Floats, contexts: Floats, scale: float) -> list[Floats]:
    """All rotations, by rising distance between shape contexts of sampled source points and the nearest target's."""
    sample = spread_indices(source, COMPARED)
    ranked = []
    unrotated = histograms(source, scale=scale)[sample]
    for number, rotation in enumerate(rotations(source.shape[1])):
        if source.shape[1] == 2:  # a rotation by whole angle bins only shifts them
            rotated = np.roll(unrotated.reshape(len(sample), -1, ANGLE_BINS), number, axis=-1).reshape(unrotated.shape)
        else:
            rotated = histograms(source @ rotation.T, scale=scale)[sample]
        ranked.append((float(chi_squared(rotated, contexts).min(axis=1).mean()), number, rotation))
    return [rotation for _, _, rotation in sorted(ranked, key=lambda item: item[:2])]


def whitening(points: Floats) -> Floats:
    """Symmetric matrix that gives points, shape (n, d), the same variance in all directions."""
    value, axis = np.linalg.eigh(np.cov(points, rowvar=False))
    return np.asarray((axis / np.sqrt(value * len(value))) @ axis.T)


def rotations(dimension: int) -> Floats:
    """Rotation matrices, shape (k, d, d): by whole angle bins in the plane, those of the icosahedron in space."""
    if dimension == 3:
        return np.asarray(scipy.spatial.transform.Rotation.create_group("I").as_matrix())
    angles = 2 * np.pi * np.arange(ANGLE_BINS) / ANGLE_BINS
    return np.moveaxis(np.array([[np.cos(angles), -np.sin(angles)], [np.sin(angles), np.cos(angles)]]), 2, 0)


def agreed(source: Floats, partners: Floats, trust: Floats, *, rng: np.random.Generator) -> Pose:
    """Consensus of pairs (n, d): the best of the affine maps through d + 1 pairs drawn by ``trust`` (RANSAC).

    Where no sample gives a plausible map, the result is a translation.
    """
    count, dimension = source.shape
    chance = trust + 1e-9
    drawn = rng.choice(count, size=(DRAWS, dimension + 1), p=chance / chance.sum())
    from_, to = source[drawn], partners[drawn]
    spread, extent = from_[:, 1:] - from_[:, :1], to[:, 1:] - to[:, :1]
    wide = np.abs(np.linalg.det(spread)) > LEAST_SPREAD
    matrix = np.linalg.solve(spread[wide], extent[wide])
    volume = np.linalg.det(matrix)
    size = np.maximum(volume, 1e-12) ** (2 / dimension)
    plausible = (volume > LEAST_VOLUME) & (volume < MOST_VOLUME)
    plausible &= (matrix**2).sum(axis=(1, 2)) < MOST_SHEAR * dimension * size
    matrix = np.concatenate([matrix[plausible], np.eye(dimension)[None]])
    origin_from = np.concatenate([from_[wide, 0][plausible], source.mean(axis=0)[None]])
    origin_to = np.concatenate([to[wide, 0][plausible], partners.mean(axis=0)[None]])
    shift = origin_to - (origin_from[:, None, :] @ matrix)[:, 0]
    closeness = _closeness(source, partners, matrix, shift, chance / chance.sum(), CLOSE)
    best = int(np.argmax(closeness))
    return Pose(affine=np.vstack([shift[best], matrix[best]]), agreement=float(closeness[best]))


@fused
def _closeness(source: Floats, partners: Floats, matrix: Floats, shift: Floats, chance: Floats, close: float) -> Floats:
    """Weight of the pairs, by their distance up to ``close``, that agree on each affine map, shape (t,)."""
    closeness = np.zeros(len(matrix))
    for number in range(len(matrix)):
        for i in range(len(source)):
            squared = 0.0
            for axis in range(source.shape[1]):
                away = shift[number, axis] - partners[i, axis]
                for other in range(source.shape[1]):
                    away += source[i, other] * matrix[number, other, axis]
                squared += away * away
            closeness[number] += chance[i] * max(1 - squared / close**2, 0.0)
    return closeness
