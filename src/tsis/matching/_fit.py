"""Interface of the matching methods, their one-to-one pairs of least cost, and samples of large sets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import linear_sum_assignment
from scipy.sparse import csr_array
from scipy.sparse.csgraph import min_weight_full_bipartite_matching
from scipy.spatial import KDTree
from scipy.spatial.distance import cdist

from tsis.errors import InputError
from tsis.model import require_array

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

Booleans = NDArray[np.bool]
Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

UNMATCHED = -1
BLOCK = 20_000  # points transformed at once


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MatchFit:
    """Result of a method, in its normalised coordinates."""

    move: Move  # map from the source's coordinates, shape (k, d), to the target's
    matches: Integers  # index of each source point's target point, or `UNMATCHED`, shape (n,); no target point twice
    trust: Floats  # confidence of each match, in [0, 1], shape (n,); 0 where there is none


class Move(Protocol):
    """A map of points, shape (k, d), to points."""

    def __call__(self, points: Floats, /) -> Floats:
        """Transform the points."""


def transformed_in_blocks(move: Move, points: Floats) -> Floats:
    """Transform many points, shape (k, d), in blocks of limited memory."""
    return np.concatenate([move(points[start : start + BLOCK]) for start in range(0, len(points), BLOCK)])


class MatchMethod(Protocol):
    """A method that matches two normalised point sets, shapes (n, d) and (m, d), with d = 2 or 3.

    A normalised set has its mean in the origin and a root-mean-square distance of 1 from it. All randomness comes from
    ``rng``.
    """

    def __call__(self, source: Floats, target: Floats, /, *, rng: np.random.Generator) -> MatchFit:
        """Match the sets."""


def require_points(name: str, value: ArrayLike, dimension: int | None = None) -> Floats:
    """Points of shape (n, d) with d = 2 or 3, or with d = ``dimension``."""
    points = require_array(name, value, ndim=2)
    if points.shape[1] not in ((2, 3) if dimension is None else (dimension,)):
        required = "2 or 3" if dimension is None else str(dimension)
        raise InputError(f"{name} must have {required} coordinates each; got shape {points.shape}")
    return points


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NormalFrame:
    """Centre, shape (d,), and size of a point set in its own unit."""

    centre: Floats
    size: float

    @classmethod
    def of(cls, points: Floats) -> NormalFrame:
        """The frame of points, shape (n, d), that do not all coincide."""
        centre = points.mean(axis=0)
        return cls(centre=centre, size=float(np.sqrt(((points - centre) ** 2).sum(axis=1).mean())))

    def inward(self, points: Floats) -> Floats:
        """From the set's own unit to its frame."""
        return np.asarray((points - self.centre) / self.size)

    def outward(self, points: Floats) -> Floats:
        """From the frame to the set's own unit."""
        return np.asarray(points * self.size + self.centre)


def ridge_solution(normal: Floats, right: Floats, ridge: Floats | float) -> Floats:
    """Solution x of ``(normal + diag(ridge)) x = right``, shape (k, d), for inner loops: inputs are not checked.

    ``normal``, shape (k, k), is symmetric and is overwritten.
    """
    normal[np.diag_indices_from(normal)] += ridge
    factor = cho_factor(normal, overwrite_a=True, check_finite=False)
    return np.asarray(cho_solve(factor, right, check_finite=False))


TOLERANCE_SD = 3.0  # tolerance in standard deviations of a point's position


def nearest_pairs(transformed: Floats, target: Floats, *, tolerance: float) -> tuple[Integers, Floats]:
    """Match transformed points (n, d) with target points (m, d) at the least sum of squared distances.

    Points farther apart than ``tolerance`` are unmatched. Returns the index of each point's target, or `UNMATCHED`, no
    target twice, and the trust in it, both of shape (n,). The trust is the probability of the match for normal
    positions with a standard deviation of a third of the tolerance, where no partner is as likely as a partner at the
    tolerance; 0 where there is no match.

    Examples
    --------
    >>> matches, _ = nearest_pairs(np.array([[0.0], [5.0]]), np.array([[9.0], [0.1]]), tolerance=1.0)
    >>> matches.tolist()
    [1, -1]
    """
    squared = cdist(transformed, target, "sqeuclidean")
    matches = assign(squared, dummy=tolerance**2)
    likely = np.exp(-0.5 * squared * (TOLERANCE_SD / tolerance) ** 2)
    chance = likely / (likely.sum(axis=1, keepdims=True) + np.exp(-0.5 * TOLERANCE_SD**2))
    return matches, np.where(matches == UNMATCHED, 0.0, chance[np.arange(len(matches)), matches])


def assign(cost: Floats, *, dummy: float) -> Integers:
    """Column of each row, or `UNMATCHED`, in the cheapest pairing with columns; an unmatched row costs ``dummy``.

    Examples
    --------
    >>> assign(np.array([[1.0, 2.0], [1.1, 9.0]]), dummy=5.0).tolist()
    [1, 0]
    """
    # All pairs that cost at least ``dummy`` are equivalent: their rows are unmatched.
    rows, columns = linear_sum_assignment(np.minimum(cost, dummy))
    matches = np.full(len(cost), UNMATCHED, dtype=np.int64)
    cheap = cost[rows, columns] < dummy
    matches[rows[cheap]] = columns[cheap]
    return matches


def assign_sparse(rows: Integers, columns: Integers, cost: Floats, shape: tuple[int, int], *, dummy: float) -> Integers:
    """`assign` with all pairs but the given ones left out, for sets whose table of all pairs is large.

    Examples
    --------
    >>> rows, columns = np.array([0, 0, 1, 1]), np.array([0, 1, 0, 1])
    >>> assign_sparse(rows, columns, np.array([1.0, 2.0, 1.1, 9.0]), (2, 2), dummy=5.0).tolist()
    [1, 0]
    """
    count, cheap = shape[0], cost < dummy
    own = np.arange(count)  # a column for each row that stays without partner
    table = csr_array(
        (
            np.concatenate([cost[cheap], np.full(count, dummy)]) + 1.0,  # a stored zero would count as no pair
            (np.concatenate([rows[cheap], own]), np.concatenate([columns[cheap], shape[1] + own])),
        ),
        shape=(count, shape[1] + count),
    )
    _, partner = min_weight_full_bipartite_matching(table)
    return np.where(partner < shape[1], partner, UNMATCHED).astype(np.int64)


def spacing(points: Floats) -> float:
    """Median distance of distinct points, shape (n, d), to their nearest neighbour; 0 for a single point."""
    positions = np.unique(points, axis=0)
    distance, _ = KDTree(positions).query(positions, k=[2])
    return float(np.median(distance)) if len(positions) > 1 else 0.0


MOST_PAIRS = 16_000_000  # 128 MB a table; a method allocates a few of them
SAMPLE = 2000  # points of the source; the target gets the rest of MOST_PAIRS
MOST_POINTS = 200_000  # moved in each alternative pose, which takes seconds
MUTUAL_RANGE = 0.5  # largest distance of a match, of the target's spacing


def drawn(source: Floats, target: Floats, *, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Samples of two normalised sets, shapes (n, d) and (m, d), with at most `MOST_PAIRS` pairs; small sets unchanged.

    The target's sample is larger, so that it contains the partners of most sampled source points, for up to some 8000
    points; in larger sets only outlines and densities agree.
    """
    if len(source) * len(target) <= MOST_PAIRS:
        return source, target

    def some(points: Floats, count: int) -> Floats:
        return points[np.sort(rng.permutation(len(points))[:count])]

    return some(source, SAMPLE), some(target, MOST_PAIRS // SAMPLE)


def matched_all(fit: MatchFit, source: Floats, target: Floats) -> MatchFit:
    """The fit of samples, with mutual nearest neighbours of all normalised points, shapes (n, d) and (m, d)."""
    transformed = transformed_in_blocks(fit.move, source)
    matches, trust = mutual_nearest(transformed, target)
    return MatchFit(move=fit.move, matches=matches, trust=trust)


def mutual_nearest(transformed: Floats, target: Floats) -> tuple[Integers, Floats]:
    """Mutual nearest neighbours within `MUTUAL_RANGE` of the target's spacing, and their weights, shapes (n,)."""
    away, nearest = KDTree(target).query(transformed)
    _, back = KDTree(transformed).query(target)
    extent = MUTUAL_RANGE * spacing(target)
    mutual = (np.asarray(back)[nearest] == np.arange(len(transformed))) & (away <= extent)
    matches = np.where(mutual, nearest, UNMATCHED).astype(np.int64)
    return matches, np.where(mutual, 1 - away / extent / 2, 0.0)
