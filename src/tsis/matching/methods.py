"""Interface of the matching methods, and what they share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
import scipy
from numpy.typing import NDArray

from tsis.compiled import fused
from tsis.errors import InputError
from tsis.model.require import require_array

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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Copies:
    """Which points of a set coincide."""

    first: Integers  # index of the first copy of each distinct point, rising, shape (k,)
    place: Integers  # place of each point's first copy among ``first``, shape (n,)

    @classmethod
    def of(cls, points: Floats) -> Copies:
        """Of points, shape (n, d).

        Examples
        --------
        >>> Copies.of(np.array([[3.0], [1.0], [3.0]])).place.tolist()
        [0, 1, 0]
        """
        _, first, place = np.unique(points, axis=0, return_index=True, return_inverse=True)
        order = np.argsort(first)
        rank = np.empty(len(order), dtype=np.int64)
        rank[order] = np.arange(len(order))
        return cls(first=first[order], place=rank[place.ravel()])

    @property
    def number(self) -> Integers:
        """How many copies of each point come before it, shape (n,)."""
        order = np.argsort(self.place, kind="stable")
        start = np.searchsorted(self.place[order], self.place[order])
        number = np.empty(len(order), dtype=np.int64)
        number[order] = np.arange(len(order)) - start
        return number


def copied_matches(matches: Integers, trust: Floats, source: Copies, target: Copies) -> tuple[Integers, Floats]:
    """Matches and trust of all points from those of the distinct ones, shape (k,).

    Copies of a source point take the copies of its target in turn, so that only a point with more copies than its
    target shares one.
    """
    if len(source.first) == len(source.place) and len(target.first) == len(target.place):
        return matches, trust
    order = np.argsort(target.place, kind="stable")
    start = np.searchsorted(target.place[order], np.arange(len(target.first) + 1))
    chosen = matches[source.place]
    paired = np.flatnonzero(chosen != UNMATCHED)
    among = chosen[paired]
    turn = source.number[paired] % (start[among + 1] - start[among])
    chosen[paired] = order[start[among] + turn]
    return chosen, trust[source.place]


def ridge_solution(normal: Floats, right: Floats, ridge: Floats | float) -> Floats:
    """Solution x of ``(normal + diag(ridge)) x = right``, shape (k, d), for inner loops: inputs are not checked.

    ``normal``, shape (k, k), is symmetric and is overwritten.
    """
    normal[np.diag_indices_from(normal)] += ridge
    factor = scipy.linalg.cho_factor(normal, overwrite_a=True, check_finite=False)
    return np.asarray(scipy.linalg.cho_solve(factor, right, check_finite=False))


ALIGNED = 16  # rows of a table begin and end at multiples of so many: the compiler's vectors leave none over


@fused
def normal_system(design: Floats, matches: Integers, target: Floats) -> tuple[Floats, Floats]:
    """Normal matrix, shape (k, k), and right side, shape (k, d), of the pairs of a design, shape (n, k)."""
    rows = np.flatnonzero(matches >= 0)
    return normal_matrix(design, rows, target[matches[rows]])


@fused
def normal_matrix(design: Floats, rows: Integers, partners: Floats) -> tuple[Floats, Floats]:
    """`normal_system` of some rows and their partners, shape (l, d)."""
    here = design[rows]
    across = np.ascontiguousarray(here.T)
    return across @ here, across @ partners


@fused
def ridge_map(normal: Floats, right: Floats, ridge: float) -> Floats:
    """Coordinates of the map, shape (1 + d + r, d), with a ridge on all but its affine part, by elimination."""
    rank, dimension = right.shape
    wide = -(-rank // ALIGNED) * ALIGNED
    upper, solution = np.zeros((rank, wide)), right.copy()
    upper[:, :rank] = normal
    for k in range(dimension + 1, rank):
        upper[k, k] += ridge
    for k in range(rank):
        for i in range(k + 1, rank):
            share, left = upper[k, i] / upper[k, k], i // ALIGNED * ALIGNED
            row, pivot = upper[i, left:], upper[k, left:]
            for j in range(len(row)):
                row[j] -= share * pivot[j]
            for axis in range(dimension):
                solution[i, axis] -= share * solution[k, axis]
    for k in range(rank - 1, -1, -1):
        for axis in range(dimension):
            total = solution[k, axis]
            for j in range(k + 1, rank):
                total -= upper[k, j] * solution[j, axis]
            solution[k, axis] = total / upper[k, k]
    return solution


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
    squared = scipy.spatial.distance.cdist(transformed, target, "sqeuclidean")
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
    if np.isfinite(dummy):
        return assign_listed(*_listed(np.ascontiguousarray(cost), dummy), cost.shape[1], dummy)
    rows, columns = scipy.optimize.linear_sum_assignment(cost)
    matches = np.full(len(cost), UNMATCHED, dtype=np.int64)
    matches[rows] = columns
    return matches


@fused
def _listed(cost: Floats, dummy: float) -> tuple[Integers, Integers, Floats]:
    """Pairs that cost less than ``dummy``, as `pairs_within` lists them."""
    start = np.zeros(len(cost) + 1, dtype=np.int64)
    for i in range(len(cost)):
        start[i + 1] = start[i] + (cost[i] < dummy).sum()
    column, value = np.empty(start[-1], dtype=np.int64), np.empty(start[-1])
    at = 0
    for i in range(len(cost)):
        for j in range(cost.shape[1]):
            if cost[i, j] < dummy:
                column[at], value[at] = j, cost[i, j]
                at += 1
    return start, column, value


def pairs_within(points: Floats, target: Floats, reach: Floats) -> tuple[Integers, Integers, Floats]:
    """Pairs of points, shape (n, d), with targets nearer than each one's ``reach``, shape (n,).

    Returns the place of each point's first pair, shape (n + 1,), and of all pairs, point by point, the target's index
    and the squared distance.
    """
    order = np.argsort(target[:, 0], kind="stable")
    return _within(np.ascontiguousarray(points), target[order], order, reach)


@fused
def _within(points: Floats, target: Floats, order: Integers, reach: Floats) -> tuple[Integers, Integers, Floats]:
    """`pairs_within` of a target that ascends along the first axis."""
    first_axis = np.ascontiguousarray(target[:, 0])
    start = np.zeros(len(points) + 1, dtype=np.int64)
    column, value = np.empty(8 * len(points), dtype=np.int64), np.empty(8 * len(points))
    count = 0
    for i in range(len(points)):
        first = np.searchsorted(first_axis, points[i, 0] - reach[i])
        last = np.searchsorted(first_axis, points[i, 0] + reach[i])
        for j in range(first, last):
            squared = 0.0
            for axis in range(points.shape[1]):
                squared += (points[i, axis] - target[j, axis]) ** 2
            if squared < reach[i] ** 2:
                if count == len(column):
                    column = np.append(column, np.empty(count, dtype=np.int64))
                    value = np.append(value, np.empty(count))
                column[count], value[count] = order[j], squared
                count += 1
        start[i + 1] = count
    return start, column[:count], value[:count]


@fused
def nearest_within(
    points: Floats, ordered: Floats, ascending: Integers, window: float, count: int
) -> tuple[Integers, Floats]:
    """Indices of the ``count`` nearest targets of each point within a distance, -1 where there are fewer.

    Also their distances, both of shape (n, count). The ``ordered`` targets ascend along the first axis.
    """
    first_axis = np.ascontiguousarray(ordered[:, 0])
    near = np.full((len(points), count), -1)
    away = np.full((len(points), count), np.inf)
    for i in range(len(points)):
        first = np.searchsorted(first_axis, points[i, 0] - window)
        last = np.searchsorted(first_axis, points[i, 0] + window)
        for j in range(first, last):
            squared = 0.0
            for axis in range(points.shape[1]):
                squared += (points[i, axis] - ordered[j, axis]) ** 2
            if squared >= window * window or squared >= away[i, count - 1]:
                continue
            place = count - 1
            while place > 0 and away[i, place - 1] > squared:
                away[i, place], near[i, place] = away[i, place - 1], near[i, place - 1]
                place -= 1
            away[i, place], near[i, place] = squared, ascending[j]
    return near, np.sqrt(away)


@fused
def assign_listed(start: Integers, column: Integers, cost: Floats, columns: int, dummy: float) -> Integers:
    """`assign` with the pairs of `pairs_within`, and no others, by shortest augmenting paths (Jonker and Volgenant).

    Examples
    --------
    >>> start, column = np.array([0, 2, 4]), np.array([0, 1, 0, 1])
    >>> assign_listed(start, column, np.array([1.0, 2.0, 1.1, 9.0]), 2, 5.0).tolist()
    [1, 0]
    """
    count = len(start) - 1
    matches, owner = np.full(count, -1, dtype=np.int64), np.full(columns, -1, dtype=np.int64)
    row_price, column_price = np.zeros(count), np.zeros(columns)
    length, came = np.full(columns, np.inf), np.empty(columns, dtype=np.int64)
    reached, closed = np.empty(columns, dtype=np.int64), np.zeros(columns, dtype=np.bool_)
    for root in range(count):
        row, low, found, leave, leaver = root, 0.0, 0, np.inf, root
        while True:
            if low + dummy - row_price[row] < leave:  # this row may stay without partner
                leave, leaver = low + dummy - row_price[row], row
            for k in range(start[row], start[row + 1]):
                j = column[k]
                along = low + cost[k] - row_price[row] - column_price[j]
                if not closed[j] and along < length[j]:
                    if length[j] == np.inf:
                        reached[found] = j
                        found += 1
                    length[j], came[j] = along, row
            low, at = leave, -1
            for k in range(found):
                j = reached[k]
                if not closed[j] and length[j] < low:
                    low, at = length[j], j
            if at < 0:
                break
            closed[at] = True
            if owner[at] < 0:
                break
            row = owner[at]
        row_price[root] += low
        for k in range(found):
            j = reached[k]
            if closed[j]:
                column_price[j] -= low - length[j]
                if owner[j] >= 0:
                    row_price[owner[j]] += low - length[j]
            length[j], closed[j] = np.inf, False
        if at < 0:
            at = matches[leaver]
            matches[leaver] = -1
        while at >= 0:
            row = came[at]
            owner[at] = row
            at, matches[row] = matches[row], at
    return matches


def spacing(points: Floats) -> float:
    """Median distance of distinct points, shape (n, d), to their nearest neighbour; 0 for a single point."""
    positions = np.unique(points, axis=0)
    distance, _ = scipy.spatial.KDTree(positions).query(positions, k=[2])
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
    away, nearest = scipy.spatial.KDTree(target).query(transformed)
    _, back = scipy.spatial.KDTree(transformed).query(target)
    extent = MUTUAL_RANGE * spacing(target)
    mutual = (np.asarray(back)[nearest] == np.arange(len(transformed))) & (away <= extent)
    matches = np.where(mutual, nearest, UNMATCHED).astype(np.int64)
    return matches, np.where(mutual, 1 - away / extent / 2, 0.0)
