"""Moves that lead a map of nearly right pairs to the right ones: growth, re-pairing of patches, order along curves.

Soft pairs and nearest partners end where pairs are off by a point along an outline, or where the deformation outside
the paired region exceeds the distance of the points. Each move proposes other pairs; their evidence decides.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree

from tsis.compiled import fused
from tsis.matching._fit import UNMATCHED, assign_listed, nearest_within, normal_system, pairs_within, ridge_map
from tsis.matching._pose_evidence import SIGMAS, WIDTHS, PoseEvidence, gaussian_kernel, hard_evidence
from tsis.matching._relaxation import rotations, whitening
from tsis.matching._spline import spread_indices

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tsis.matching._fit import Floats, Integers
    from tsis.matching._pose_evidence import SmoothField

ACCEPTED = 3.0  # predictive standard deviations of a pair
FARTHEST = 1.5  # spacings
GROWTHS, PATCHES, PATCH = 8, 8, 0.2
CANDIDATES, WINDOW = 12, 3.0  # targets of a point along a curve, and their largest distance in spacings
SHORTEST = 3  # points of a curve up to which it has no order
MOST_SKIPPED = 5  # points without partner between two pairs of one run
SKIP, BREAK = 2.5, 7.0  # costs of a point without partner, and of a new run
AFFINE_RIDGE = 1e-9  # on the affine part of a map of few pairs
POSITION = 1.5  # standard deviation of a position, in spacings
STRAINS = (0.35, 0.3, 0.25, 0.15, 0.1)  # standard deviations of an edge, in spacings
STIFFNESSES = (2.0, 1.0, 0.5, 0.25, 0.0)  # standard deviations of a pair of the stiff map, in spacings
STIFF_WIDTH, STIFF_AMPLITUDE = 1.6, 0.1
RANKS, RANK_SIGMA, RANK_AMPLITUDE, RANK_WIDTH = 25, 2 * SIGMAS[1], 0.1, 0.9
MOST_SHIFTS, FOLLOWED_SHIFTS = 400, 8
ROTATIONS = 24  # of the plane
MANY_PAIRS = 60_000
MOST_RUNS, SEGMENT_SHIFTS, FOLLOWED_SEGMENTS = 30, (-2, -1, 1, 2), 3


def predicted(field: SmoothField, pose: PoseEvidence) -> Floats:
    """Standard deviation of the source's moved points given the map's pairs, shape (n,)."""
    design = field.designs[WIDTHS.index(pose.width)]
    ridge = (pose.sigma / max(pose.amplitude, 1e-6)) ** 2
    return pose.sigma * _deviations(design, pose.matches, ridge, field.points.shape[1] + 1)


@fused
def _deviations(design: Floats, matches: Integers, ridge: float, affine: int) -> Floats:
    """Standard deviation at each row of ``design``, shape (n, k), in those of a pair; ``affine`` columns are free."""
    here = design[np.flatnonzero(matches >= 0)]
    normal = np.ascontiguousarray(here.T) @ here
    for k in range(len(normal)):
        normal[k, k] += AFFINE_RIDGE if k < affine else ridge
    factor = np.linalg.cholesky(normal)
    whitened = np.ascontiguousarray(design.T)
    total = np.zeros(len(design))
    for k in range(len(factor)):
        for other in range(k):
            share = factor[k, other]
            for i in range(len(design)):
                whitened[k, i] -= share * whitened[other, i]
        for i in range(len(design)):
            whitened[k, i] /= factor[k, k]
            total[i] += whitened[k, i] ** 2
    return np.sqrt(total)


def _stiff_map(field: SmoothField, target: Floats, matches: Integers, sigma: float) -> Floats:
    """Mean of the source's points, shape (n, d), under a stiff field and pairs with a standard deviation."""
    return _mean(field.designs[WIDTHS.index(STIFF_WIDTH)], matches, target, (sigma / STIFF_AMPLITUDE) ** 2)


@fused
def _mean(design: Floats, matches: Integers, target: Floats, ridge: float) -> Floats:
    normal, right = normal_system(design, matches, target)
    for k in range(right.shape[1] + 1):
        normal[k, k] += AFFINE_RIDGE
    return design @ ridge_map(normal, right, ridge)


def _paired_again(target: Floats, moved: Floats, radius: Floats, farthest: float) -> Integers:
    start, column, squared = pairs_within(moved, target, np.minimum(ACCEPTED * radius, farthest))
    cost = squared / np.repeat(radius, np.diff(start)) ** 2
    return assign_listed(start, column, cost, len(target), ACCEPTED**2)


def grown(field: SmoothField, target: Floats, step: float, pose: PoseEvidence) -> PoseEvidence:
    """The map after pairs are added and dropped within their predictive standard deviations."""
    best = pose
    for _ in range(GROWTHS):
        radius = np.hypot(predicted(field, best), best.sigma)
        matches = _paired_again(target, best.moved, radius, FARTHEST * step)
        if np.array_equal(matches, best.matches):
            break
        item = hard_evidence(field, target, matches, width=best.width)
        if item is None or item.log <= best.log + 0.01:
            break
        best = item
    return best


def repatched(field: SmoothField, target: Floats, step: float, pose: PoseEvidence) -> PoseEvidence:
    """The map after the pairs of each patch are predicted from all others."""
    best, points = pose, field.points
    count = max(int(PATCH * len(points)), 4)
    tree = KDTree(points)
    for centre in spread_indices(points, PATCHES):
        near = np.asarray(tree.query(points[centre], k=count)[1])
        matches = best.matches.copy()
        matches[near] = UNMATCHED
        left = hard_evidence(field, target, matches, width=best.width)
        if left is None:
            continue
        radius = np.hypot(predicted(field, left), left.sigma)
        matches = _paired_again(target, left.moved, radius, FARTHEST * step)
        if np.array_equal(matches, best.matches):
            continue
        item = hard_evidence(field, target, matches, width=best.width)
        if item is not None and item.log > best.log + 0.01:
            best = item
    return best


def chained(
    field: SmoothField, target: Floats, step: float, curves: list[tuple[Integers, bool]], pose: PoseEvidence
) -> PoseEvidence:
    """The map after pairs along the source's curves follow the predicted edges rather than the predicted positions."""
    long = [order for order, _ in curves if len(order) > SHORTEST]
    if not long:
        return pose
    order, ends = np.concatenate(long), np.cumsum([len(curve) for curve in long])
    ascending = np.argsort(target[:, 0], kind="stable")
    ordered = target[ascending]
    best, current = pose, pose
    for strain, stiffness in zip(STRAINS, STIFFNESSES, strict=True):
        moved = current.moved
        if stiffness:
            moved = _stiff_map(field, target, current.matches, stiffness * step)
        matches = _along_curves(
            moved, target, order, ends, ordered, ascending, WINDOW * step, strain * step, POSITION * step
        )
        item = hard_evidence(field, target, matches, width=current.width)
        if item is None:
            break
        current = item
        if item.log > best.log + 0.01:
            best = item
    if best is pose:
        return pose
    whole = hard_evidence(field, target, best.matches)
    return best if whole is None else whole


@fused
def _along_curves(
    moved: Floats,
    target: Floats,
    order: Integers,
    ends: Integers,
    ordered: Floats,
    ascending: Integers,
    window: float,
    strain: float,
    position: float,
) -> Integers:
    """Cheapest targets along all curves, no target twice.

    ``order`` has the points of curve after curve, which end at ``ends``. The ``ordered`` targets ascend along the first
    axis.
    """
    matches, cost = np.full(len(moved), -1), np.full(len(target), np.inf)
    first = 0
    for last in ends:
        curve = order[first:last]
        along = moved[curve]
        near, away = nearest_within(along, ordered, ascending, window, CANDIDATES)
        matches[curve] = _run_matches(along, target, near, away, strain, position)
        first = last
    owner = np.full(len(target), -1)
    for i in range(len(moved)):
        j = matches[i]
        if j < 0:
            continue
        squared = ((moved[i] - target[j]) ** 2).sum()
        if squared < cost[j]:
            if owner[j] >= 0:
                matches[owner[j]] = -1
            cost[j], owner[j] = squared, i
        else:
            matches[i] = -1
    return matches


@fused
def _run_matches(
    moved: Floats, target: Floats, near: Integers, away: Floats, strain: float, position: float
) -> Integers:
    """Cheapest targets along one curve; an edge costs its squared difference from the moved edge."""
    count, candidates = near.shape
    dimension = target.shape[1]
    cost = np.full((count, candidates), 1e30)
    before = np.full((count, candidates, 2), -1)
    cheapest, cheapest_at = np.full(count + 1, 0.0), np.full((count + 1, 2), -1)
    cheapest[0] = 0.0
    # cheapest[p]: least cost of a run that ends before point p, with the skipped points up to p
    for p in range(count):
        for c in range(candidates):
            j = near[p, c]
            if j < 0:
                break
            least = cheapest[p] + BREAK
            source, partner = cheapest_at[p, 0], cheapest_at[p, 1]
            for s in range(1, MOST_SKIPPED + 1):
                q = p - s
                if q < 0:
                    break
                for b in range(candidates):
                    i = near[q, b]
                    if i < 0:
                        break
                    if i == j or cost[q, b] + (s - 1) * SKIP >= least:
                        continue
                    squared = 0.0
                    for axis in range(dimension):
                        edge = target[j, axis] - target[i, axis] - moved[p, axis] + moved[q, axis]
                        squared += edge * edge
                    total = cost[q, b] + 0.5 * squared / (strain * strain * s) + (s - 1) * SKIP
                    if total < least:
                        least, source, partner = total, q, b
            cost[p, c] = least + 0.5 * (away[p, c] / position) ** 2
            before[p, c, 0], before[p, c, 1] = source, partner
        cheapest[p + 1] = cheapest[p] + SKIP
        cheapest_at[p + 1, 0], cheapest_at[p + 1, 1] = cheapest_at[p, 0], cheapest_at[p, 1]
        for c in range(candidates):
            if cost[p, c] < cheapest[p + 1]:
                cheapest[p + 1] = cost[p, c]
                cheapest_at[p + 1, 0], cheapest_at[p + 1, 1] = p, c
    matches = np.full(count, -1)
    p, c = cheapest_at[count, 0], cheapest_at[count, 1]
    while p >= 0:
        matches[p] = near[p, c]
        p, c = before[p, c, 0], before[p, c, 1]
    return matches


def shifted(curve: tuple[Integers, bool], ranking: Ranking, pose: PoseEvidence) -> Iterator[Integers]:
    """Matches that slid along a closed curve of the source by any number of points, the likeliest first."""
    order, closed = curve
    if not closed or not 0 < len(order) <= MOST_SHIFTS:
        return
    count = len(order)
    along = pose.matches[order]
    chosen = np.flatnonzero(along != UNMATCHED)
    places = (chosen[None, :] + np.arange(count)[:, None]) % count
    stacked = ranking.design[order][places]  # shape (shifts, pairs, k)
    goal = ranking.target[along[chosen]]
    across = stacked.transpose(0, 2, 1)
    loss = ranking.loss(across @ stacked, across @ goal, goal)
    lowest = (loss <= np.roll(loss, 1)) & (loss <= np.roll(loss, -1))
    lowest[0] = False
    for number in np.lexsort((loss, ~lowest))[:FOLLOWED_SHIFTS]:
        matches = np.full(len(pose.matches), UNMATCHED, dtype=np.int64)
        matches[order[places[number]]] = along[chosen]
        yield matches


def segment_shifts(order: Integers, closed: bool, ranking: Ranking, pose: PoseEvidence) -> Iterator[Integers]:
    """Matches of which a segment between two unpaired points slid into one of the gaps, the likeliest first."""
    along = pose.matches[order]
    paired = along != UNMATCHED
    if closed and not paired.all():
        order = np.roll(order, -int(np.flatnonzero(~paired)[0]))
        along = pose.matches[order]
        paired = along != UNMATCHED
    count = len(order)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], paired, [False]]).astype(int)))
    starts, ends = edges[::2], edges[1::2]
    if not 0 < len(starts) <= MOST_RUNS:
        return
    before = np.diff(np.concatenate([[0], np.column_stack([starts, ends]).ravel(), [count]]))[::2]
    design, goal = ranking.design[order], ranking.target[np.maximum(along, 0)] * paired[:, None]
    outer = design[:, :, None] * design[:, None, :]
    base, right = outer[paired].sum(axis=0), design[paired].T @ goal[paired]
    normals, rights, chosen = [], [], []
    for shift in SEGMENT_SHIFTS:
        moved = np.roll(design, -shift, axis=0)
        some = paired.astype(float)
        change = np.cumsum(some[:, None, None] * (np.roll(outer, -shift, axis=0) - outer), axis=0)
        pull = np.cumsum((some[:, None] * (moved - design))[:, :, None] * goal[:, None, :], axis=0)
        change = np.concatenate([np.zeros_like(change[:1]), change])
        pull = np.concatenate([np.zeros_like(pull[:1]), pull])
        for first in range(len(starts)):
            for last in range(first, len(starts)):
                room = before[last + 1] if shift > 0 else before[first]
                if room < abs(shift) or (closed and first == 0 and last == len(starts) - 1):
                    continue
                a, b = starts[first], ends[last]
                normals.append(change[b] - change[a])
                rights.append(pull[b] - pull[a])
                chosen.append((a, b, shift))
    if not chosen:
        return
    loss = ranking.loss(base + np.array(normals), right + np.array(rights), goal[paired])
    for number in np.argsort(loss, kind="stable")[:FOLLOWED_SEGMENTS]:
        a, b, shift = chosen[number]
        slid_along = along.copy()
        slid_along[a:b] = UNMATCHED
        slid_along[a + shift : b + shift] = np.where(paired[a:b], along[a:b], slid_along[a + shift : b + shift])
        matches = pose.matches.copy()
        matches[order] = slid_along
        yield matches


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ranking:
    """A stiff field of low rank, whose loss ranks many sets of pairs at once."""

    design: Floats  # affine and bending columns at the source's points, shape (n, k)
    target: Floats  # shape (m, d)

    @classmethod
    def of(cls, field: SmoothField, target: Floats) -> Ranking:
        """The ranking of pairs with the target's points."""
        factor = field.factors[WIDTHS.index(RANK_WIDTH)][:, -RANKS:] * RANK_AMPLITUDE
        return cls(design=np.column_stack([np.ones(len(factor)), field.points, factor]), target=target)

    def loss(self, normal: Floats, right: Floats, goal: Floats) -> Floats:
        """Squared residuals and bending, shape (s,), of normal matrices (s, k, k) and right sides (s, k, d).

        ``goal`` holds the partners, shape (l, d) for all or (s, l, d).
        """
        ridge = np.full(self.design.shape[1], RANK_SIGMA**2)
        ridge[: self.target.shape[1] + 1] = 1e-9
        solution = np.linalg.solve(normal + np.diag(ridge), right)
        return np.asarray((goal**2).sum(axis=(-2, -1)) - (right * solution).sum(axis=(1, 2)))


def one_to_one(moved: Floats, target: Floats, gate: float) -> Integers:
    """Pairs within a distance: cheapest in total, of very many points mutual nearest neighbours."""
    if len(moved) * len(target) <= MANY_PAIRS:
        start, column, squared = pairs_within(moved, target, np.full(len(moved), gate))
        return assign_listed(start, column, squared, len(target), gate**2)
    nearest, back = _nearest(moved, target, gate), _nearest(target, moved, gate)
    rows = np.flatnonzero(nearest != UNMATCHED)
    mutual = rows[back[nearest[rows]] == rows]
    matches = np.full(len(moved), UNMATCHED, dtype=np.int64)
    matches[mutual] = nearest[mutual]
    return matches


def _nearest(points: Floats, others: Floats, gate: float) -> Integers:
    """Index of each point's nearest other within a distance, or `UNMATCHED`, shape (n,)."""
    order = np.argsort(others[:, 0], kind="stable")
    near, _ = nearest_within(np.ascontiguousarray(points), others[order], order, gate, 1)
    return near[:, 0]


def rotated(field: SmoothField, target: Floats, step: float, pose: PoseEvidence) -> Iterator[PoseEvidence]:
    """Maps of the rotated source by the map found: other poses of a shape that nearly has a symmetry."""
    if field.points.shape[1] != 2:
        return
    white = whitening(field.points)
    back = np.linalg.inv(white)
    for turn in plane_rotations()[1:]:
        points = field.points @ (white @ turn @ back)
        bent = gaussian_kernel(points, field.control, pose.width) @ pose.kernel_weights
        moved = pose.affine[0] + points @ pose.affine[1:] + bent
        item = hard_evidence(field, target, one_to_one(moved, target, FARTHEST * step), width=pose.width)
        if item is not None:
            yield item


def plane_rotations() -> Floats:
    """Rotation matrices of the plane at equal angles, shape (k, 2, 2)."""
    angle = 2 * np.pi * np.arange(ROTATIONS) / ROTATIONS
    return np.moveaxis(np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]), 2, 0)


def start_matrices(source: Floats, target: Floats) -> Iterator[Floats]:
    """Rotations, of sets of different numbers in two sizes, and rotations between the whitened sets."""
    dimension = source.shape[1]
    turns = rotations(dimension) if dimension == 3 else plane_rotations()
    ratio = len(target) / len(source)
    for size in (1.0, 0.75) if ratio > 1.15 else (1.0, 1.25) if ratio < 0.9 else (1.0,):
        yield from size * turns
    here, there = whitening(source), np.linalg.inv(whitening(target))
    yield from (here @ turn @ there for turn in turns)
