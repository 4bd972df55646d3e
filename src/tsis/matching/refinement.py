"""Moves that lead a map of nearly right pairs to the right ones.

Soft pairs and nearest partners end where pairs are off by a point along an outline, or where the deformation outside
the paired region exceeds the distance of the points. Each move proposes other pairs; their evidence decides.
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.compiled import fused
from tsis.matching.methods import (
    ALIGNED,
    UNMATCHED,
    assign_listed,
    nearest_within,
    normal_system,
    pairs_within,
    ridge_map,
)
from tsis.matching.outline import LEAST_PIECE, LEFT_OUT
from tsis.matching.pose_evidence import WIDTHS, PoseEvidence, gaussian_kernel, hard_evidence
from tsis.matching.relaxation import rotations, whitening
from tsis.matching.spline import spread_indices

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tsis.matching.methods import Booleans, Floats, Integers
    from tsis.matching.outline import Ranking
    from tsis.matching.pose_evidence import SmoothField


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
MOST_SHIFTS, FOLLOWED_SHIFTS = 400, 8
RATES = (0, -1, 1, -2, 2, -3, 3)  # points by which the last run of pairs slides farther than the first
ROTATIONS = 24  # of the plane
MANY_PAIRS = 60_000
# Fraction of the points without partner from which they are moved together, displacements that are tried, their largest
# length in root-mean-square radii, and the cells that count them, in spacings
LEAST_LOOSE, DISPLACEMENTS, REACH, CELL = 0.05, 6, 1.5, 1.5
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
        proposed = hard_evidence(field, target, matches, width=best.width)
        if proposed is None or proposed.log <= best.log + 0.01:
            break
        best = proposed
    return best


def repatched(field: SmoothField, target: Floats, step: float, pose: PoseEvidence) -> PoseEvidence:
    """The map after the pairs of each patch are predicted from all others."""
    best, points = pose, field.points
    count = max(int(PATCH * len(points)), 4)
    tree = scipy.spatial.KDTree(points)
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
        proposed = hard_evidence(field, target, matches, width=best.width)
        if proposed is not None and proposed.log > best.log + 0.01:
            best = proposed
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
        proposed = hard_evidence(field, target, matches, width=current.width)
        if proposed is None:
            break
        current = proposed
        if proposed.log > best.log + 0.01:
            best = proposed
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
    dimension, wide = target.shape[1], -(-candidates // ALIGNED) * ALIGNED
    partner, offset = np.full((count, wide), -1), np.zeros((count, dimension, wide))
    cost, before = np.full((count, wide), 1e30), np.full((count, wide), -1)
    for p in range(count):
        for c in range(candidates):
            partner[p, c] = near[p, c]
            for axis in range(dimension):
                offset[p, axis, c] = target[near[p, c], axis] - moved[p, axis] if near[p, c] >= 0 else 0.0
    cheapest, cheapest_at = np.zeros(count + 1), np.full(count + 1, -1)
    squared = np.empty(wide)
    # cheapest[p]: least cost of a run that ends before point p, with the skipped points up to p
    for p in range(count):
        least, source, own = cost[p], before[p], partner[p]
        least[:], source[:] = cheapest[p] + BREAK, cheapest_at[p]
        for s in range(1, min(MOST_SKIPPED, p) + 1):
            for b in range(candidates):
                other, start = partner[p - s, b], cost[p - s, b] + (s - 1) * SKIP
                if other < 0:
                    break
                if start >= cheapest[p] + BREAK:
                    continue
                squared[:] = 0.0
                for axis in range(dimension):
                    edge = offset[p - s, axis, b]
                    for c in range(wide):
                        squared[c] += (offset[p, axis, c] - edge) ** 2
                scale, at = 0.5 / (strain * strain * s), (p - s) * wide + b
                for c in range(wide):
                    total = start + scale * squared[c]
                    better = (total < least[c]) & (own[c] != other)
                    least[c] = total if better else least[c]
                    source[c] = at if better else source[c]
        cheapest[p + 1], cheapest_at[p + 1] = cheapest[p] + SKIP, cheapest_at[p]
        for c in range(wide):
            if own[c] < 0:
                least[c] = 1e30
                continue
            least[c] += 0.5 * (away[p, c] / position) ** 2
            if least[c] < cheapest[p + 1]:
                cheapest[p + 1], cheapest_at[p + 1] = least[c], p * wide + c
    matches = np.full(count, -1)
    at = cheapest_at[count]
    while at >= 0:
        matches[at // wide] = partner[at // wide, at % wide]
        at = before[at // wide, at % wide]
    return matches


def shifted(curve: tuple[Integers, bool], ranking: Ranking, pose: PoseEvidence) -> Iterator[Integers]:
    """Matches that slid along a curve of the source by any number of points, the likeliest first.

    Runs of pairs beside hidden parts also slide by different numbers, which grow or fall along the curve: a hidden part
    may have more or fewer points than the map gives it. Pairs that slide beyond an end of an open curve are dropped.
    """
    order, closed = curve
    count = len(order)
    along = pose.matches[order] if count else np.empty(0, dtype=np.int64)
    chosen = np.flatnonzero(along != UNMATCHED)
    if not len(chosen) or count > MOST_SHIFTS:
        return
    if closed:  # the curve is cut at its longest hidden part
        widest = int(np.diff(chosen, prepend=chosen[-1] - count).argmax())
        order, along = np.roll(order, -chosen[widest]), np.roll(along, -chosen[widest])
        chosen = np.flatnonzero(along != UNMATCHED)
    run = np.cumsum(np.diff(chosen, prepend=chosen[0]) > 1)
    rates = np.array(RATES) if 0 < run[-1] <= MOST_RUNS else np.zeros(1)
    steps = np.arange(count) if closed else np.arange(-chosen[-1], count - chosen[0])
    extra = np.rint(rates[:, None] * run / max(run[-1], 1)).astype(np.int64)
    places = (chosen + extra[:, None, :] + steps[None, :, None]).reshape(-1, len(chosen))
    inside = np.ones(places.shape, dtype=bool) if closed else (places >= 0) & (places < count)
    kept = inside.sum(axis=1) >= min(LEAST_PIECE, len(chosen))
    places, inside = places[kept] % count, inside[kept]
    loss = ranking.placed_loss(order, places, inside, ranking.target[along[chosen]])
    loss += LEFT_OUT * (~inside).sum(axis=1)
    lowest = (loss <= np.roll(loss, 1)) & (loss <= np.roll(loss, -1))
    for number in np.lexsort((loss, ~lowest))[:FOLLOWED_SHIFTS]:
        matches = np.full(len(pose.matches), UNMATCHED, dtype=np.int64)
        matches[order[places[number, inside[number]]]] = along[chosen[inside[number]]]
        if (matches != pose.matches).any():
            yield matches


def segment_shifts(
    order: Integers, closed: bool, ahead: Integers, ranking: Ranking, pose: PoseEvidence
) -> Iterator[Integers]:
    """Matches of which a segment beside an unpaired point slid into the gap, the likeliest first.

    Its other end is at an unpaired point too, or where the partners skip a target along the curves, which ``ahead``,
    shape (m,), describes.
    """
    along = pose.matches[order]
    paired = along != UNMATCHED
    joined, kept = _joined_pairs(along, ahead)
    if closed and not paired.all():  # the curve is cut where partners skip a target, else at a point without partner
        cut = np.flatnonzero(joined & ~kept) + 1 if (joined & ~kept).any() else np.flatnonzero(~paired)
        order = np.roll(order, -int(cut[0]))
        along = pose.matches[order]
        paired = along != UNMATCHED
        joined, kept = _joined_pairs(along, ahead)
    count = len(order)
    joined, kept = joined[:-1], kept[:-1]
    for same in (kept, joined):
        starts = np.flatnonzero(paired & ~np.append(False, same))
        ends = np.flatnonzero(paired & ~np.append(same, False)) + 1
        if len(starts) <= MOST_RUNS:
            break
    if not 0 < len(starts) <= MOST_RUNS:
        return
    before = np.append(starts, count) - np.append(0, ends)
    design, goal = ranking.design[order], ranking.target[np.maximum(along, 0)]
    base, right = _run_systems(design, goal, starts, ends)
    first, last = np.triu_indices(len(starts))
    whole = closed & (first == 0) & (last == len(starts) - 1)
    losses, chosen = [], []
    for shift in SEGMENT_SHIFTS:
        room = before[last + 1] if shift > 0 else before[first]
        some = np.flatnonzero((room >= abs(shift)) & ~whole)
        if not len(some):
            continue
        normal, pull = _run_systems(np.roll(design, -shift, axis=0), goal, starts, ends)
        change = np.cumsum(np.concatenate([np.zeros_like(base[:1]), normal - base]), axis=0)
        drawn = np.cumsum(np.concatenate([np.zeros_like(right[:1]), pull - right]), axis=0)
        normals = base.sum(axis=0) + change[last[some] + 1] - change[first[some]]
        rights = right.sum(axis=0) + drawn[last[some] + 1] - drawn[first[some]]
        losses.append(ranking.loss(normals, rights, goal[paired]))
        chosen += [(starts[a], ends[b], shift) for a, b in zip(first[some], last[some], strict=True)]
    if not chosen:
        return
    loss = np.concatenate(losses)
    for number in np.argsort(loss, kind="stable")[:FOLLOWED_SEGMENTS]:
        a, b, shift = chosen[number]
        slid_along = along.copy()
        slid_along[a:b] = UNMATCHED
        slid_along[a + shift : b + shift] = np.where(paired[a:b], along[a:b], slid_along[a + shift : b + shift])
        matches = pose.matches.copy()
        matches[order] = slid_along
        yield matches


def reattached(field: SmoothField, target: Floats, step: float, pose: PoseEvidence) -> Iterator[Integers]:
    """Matches in which the points without partner, moved together, meet free targets, those first that meet most.

    Growth adds pairs near their predicted places. A part of the shape that the deformation moved farther, or that a
    part of the clutter holds, has to be found anew: displacements from its places to free targets are counted.
    """
    loose = np.flatnonzero(pose.matches == UNMATCHED)
    free = np.setdiff1d(np.arange(len(target)), pose.matches)
    if len(loose) < max(LEAST_LOOSE * len(pose.matches), field.points.shape[1] + 1) or len(free) < len(loose) / 2:
        return
    size = CELL * step
    for places in (pose.affine[0] + field.points[loose] @ pose.affine[1:], pose.moved[loose]):
        away = (target[free] - places[:, None]).reshape(-1, target.shape[1])
        cells, count = np.unique(np.rint(away[np.linalg.norm(away, axis=1) < REACH] / size), axis=0, return_counts=True)
        if not len(cells):
            continue
        beside = scipy.spatial.distance.cdist(cells, cells, "chebyshev") <= 1
        votes = beside @ count + count  # a cell's own pairs count twice
        for _ in range(DISPLACEMENTS):
            most = int(votes.argmax())
            near = one_to_one(places + cells[most] * size, target[free], 2 * step)
            matches = pose.matches.copy()
            matches[loose] = np.where(near == UNMATCHED, UNMATCHED, free[near])
            yield matches
            votes[beside[most]] = 0


def halved(points: Floats, matches: Integers) -> Iterator[Integers]:
    """Matches of which only the pairs on one side of the source's centre are left, from each side.

    Where clutter holds a part of the shape, the map grows anew from the other part.
    """
    centred = points - points.mean(axis=0)
    for side in product((-1, 0, 1), repeat=points.shape[1]):
        if any(side):
            yield np.where(centred @ np.array(side) > 0, matches, UNMATCHED)


def _joined_pairs(along: Integers, ahead: Integers) -> tuple[Booleans, Booleans]:
    """Whether each partner, shape (n,), and the next have pairs, and whether they are neighbours along a curve too."""
    after = np.roll(along, -1)
    joined = (along != UNMATCHED) & (after != UNMATCHED)
    return joined, joined & ((ahead[along] == after) | (ahead[after] == along))


@fused
def _run_systems(design: Floats, goal: Floats, starts: Integers, ends: Integers) -> tuple[Floats, Floats]:
    """Normal matrix and right side of the rows of each run, shapes (r, k, k) and (r, k, d)."""
    normal = np.empty((len(starts), design.shape[1], design.shape[1]))
    right = np.empty((len(starts), design.shape[1], goal.shape[1]))
    for run in range(len(starts)):
        here = design[starts[run] : ends[run]]
        across = np.ascontiguousarray(here.T)
        normal[run], right[run] = across @ here, across @ goal[starts[run] : ends[run]]
    return normal, right


def one_to_one(moved: Floats, target: Floats, gate: float) -> Integers:
    """Pairs within a distance: cheapest in total, of very many points mutual nearest neighbours."""
    if len(moved) * len(target) <= MANY_PAIRS:
        start, column, squared = pairs_within(moved, target, np.full(len(moved), gate))
        return assign_listed(start, column, squared, len(target), gate**2)
    ascending = np.argsort(target[:, 0], kind="stable")
    return _mutual(np.ascontiguousarray(moved), target[ascending], ascending, gate)


@fused
def _mutual(points: Floats, ordered: Floats, ascending: Integers, gate: float) -> Integers:
    """Index of the target within a distance that is each point's nearest and whose nearest is the point, or -1.

    The ``ordered`` targets ascend along the first axis.
    """
    first_axis = np.ascontiguousarray(ordered[:, 0])
    nearest, back = np.full(len(points), -1), np.full(len(ordered), -1)
    away, away_back = np.full(len(points), gate**2), np.full(len(ordered), gate**2)
    for i in range(len(points)):
        first = np.searchsorted(first_axis, points[i, 0] - gate)
        last = np.searchsorted(first_axis, points[i, 0] + gate)
        for j in range(first, last):
            squared = 0.0
            for axis in range(points.shape[1]):
                squared += (points[i, axis] - ordered[j, axis]) ** 2
            if squared < away[i]:
                away[i], nearest[i] = squared, j
            if squared < away_back[j]:
                away_back[j], back[j] = squared, i
    for i in range(len(points)):
        mutual = nearest[i] >= 0 and back[nearest[i]] == i
        nearest[i] = ascending[nearest[i]] if mutual else -1
    return nearest


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
        proposed = hard_evidence(field, target, one_to_one(moved, target, FARTHEST * step), width=pose.width)
        if proposed is not None:
            yield proposed


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
