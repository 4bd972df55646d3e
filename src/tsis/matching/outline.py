"""Alignments of two outlines point by point: every start on a closed one, both directions of an open one.

Short edges join the points to curves, along which pairs slide by whole points. Where both sets sample one curve with
equally many points, all their alignments are few enough to be compared at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.compiled import fused
from tsis.matching.methods import UNMATCHED
from tsis.matching.pose_evidence import SIGMAS, WIDTHS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tsis.matching.methods import Booleans, Floats, Integers
    from tsis.matching.pose_evidence import SmoothField


LIKELIEST = 24  # alignments that are returned, those first that are likelier than their neighbours
AMPLITUDE, SIGMA = 0.1, SIGMAS[1]  # of the field that ranks the alignments
MOST_POINTS = 400
NEIGHBOURS = 5
LONGEST = 3.0  # median distances of neighbours: a longer gap separates two curves
LEAST_PIECE, MOST_PIECES, LAID = 12, 3, 6  # points of a piece, number of pieces, and of places of each
LOCAL = 4  # steps on either side whose median is the step at a point
LEFT_OUT = 9 * (2 * SIGMAS[1]) ** 2  # loss of a point beyond the end of a curve: as of three standard deviations
STRAY_STEP = 0.7  # local steps, below which an edge leads to a stray point
NEARLY_WHOLE = 0.2  # largest deviation of the steps of a closed piece from those of the whole outline
RANKS, RANK_SIGMA, RANK_AMPLITUDE, RANK_WIDTH = 25, 2 * SIGMAS[1], 0.1, 0.9
NEARLY_ALL, CLOSING = 0.85, 5.0  # fraction of the points on the main curve; gap of a closed one, in median steps


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

    def placed_loss(self, order: Integers, places: Integers, inside: Booleans, goal: Floats) -> Floats:
        """`loss` of points, shape (l, d), at ``places``, shape (s, l), along a curve; only those ``inside`` count."""
        normal, right = _placed_systems(self.design[order], places, inside, goal)
        return self.loss(normal, right, np.sqrt(inside @ (goal**2).sum(axis=1))[:, None, None])


@fused
def _placed_systems(design: Floats, places: Integers, inside: Booleans, goal: Floats) -> tuple[Floats, Floats]:
    """Normal matrices, shape (s, k, k), and right sides, shape (s, k, d), of `Ranking.placed_loss`."""
    count, width = design.shape
    often, sums = np.zeros((len(places), count)), np.zeros((goal.shape[1], len(places), count))
    for s in range(len(places)):
        for k in range(len(goal)):
            if inside[s, k]:
                often[s, places[s, k]] += 1
                for axis in range(goal.shape[1]):
                    sums[axis, s, places[s, k]] += goal[k, axis]
    products = np.empty((count, width * (width + 1) // 2))
    for row in range(count):
        at = 0
        for k in range(width):
            for other in range(k + 1):
                products[row, at] = design[row, k] * design[row, other]
                at += 1
    packed = often @ products
    normal, right = np.empty((len(places), width, width)), np.empty((len(places), width, goal.shape[1]))
    for s in range(len(places)):
        at = 0
        for k in range(width):
            for other in range(k + 1):
                normal[s, k, other] = normal[s, other, k] = packed[s, at]
                at += 1
    for axis in range(goal.shape[1]):
        right[:, :, axis] = sums[axis] @ design
    return normal, right


def outline_alignments(field: SmoothField, target: Floats, following: Integers, ahead: Integers) -> list[Integers]:
    """The likeliest matches, shape (n,) each, that keep the order of points; none where the sets are no such curves.

    ``following`` has each source point's next one, ``ahead`` each target point's.
    """
    source = field.points
    if source.shape[1] != 2 or len(source) != len(target) or len(source) > MOST_POINTS:
        return []
    here, closed_here = curve_order(following)
    there, closed_there = curve_order(ahead)
    if not len(here) or not len(there) or closed_here != closed_there:
        return []
    if closed_here:
        here, there = _anticlockwise(source, here), _anticlockwise(target, there)
        shifts = np.arange(len(there))[:, None] + np.arange(len(there))
        orders = there[shifts % len(there)]
    else:
        orders = np.stack([there, there[::-1]])
    precision = _precision(field, here)
    loss = _losses(target[orders], precision)
    lowest = (loss <= np.roll(loss, 1)) & (loss <= np.roll(loss, -1))
    alignments = []
    for number in np.lexsort((loss, ~lowest))[:LIKELIEST]:
        matches = np.full(len(source), UNMATCHED, dtype=np.int64)
        matches[here] = orders[number]
        alignments.append(matches)
    return alignments


def _losses(aligned: Floats, precision: Floats) -> Floats:
    """Loss, shape (s,), of partners, shape (s, n, d), with the inverse covariance, shape (n, n), of each coordinate."""
    columns = np.moveaxis(aligned, 1, 0).reshape(len(precision), -1)
    return np.asarray((columns * (precision @ columns)).sum(axis=0).reshape(len(aligned), -1).sum(axis=1))


def laid_pieces(curve: tuple[Integers, bool], ranking: Ranking, following: Integers) -> Iterator[Integers]:
    """Matches, shape (n,), of pieces of the target's curves laid on each place of a curve of the source.

    ``following`` has each target point's next one. Of each piece the places come that fit better than their neighbours,
    the likeliest first. Points beyond the end of an open curve have no match.
    """
    order, closed = curve
    count = len(order)
    if not LEAST_PIECE <= count <= MOST_POINTS:
        return
    long = sorted((piece for piece, _ in chains(following) if len(piece) >= LEAST_PIECE), key=len, reverse=True)
    for piece in (part for whole in long[:MOST_PIECES] for part in (whole, whole[::-1])):
        position = _positions(ranking.target[piece], count if closed else 0)
        first = 0 if closed else LEAST_PIECE - 1 - position[-1]
        places = position + np.arange(first, count if closed else count - LEAST_PIECE + 1)[:, None]
        inside = position < count if closed else (places >= 0) & (places < count)
        inside = np.broadcast_to(inside, places.shape)
        places %= count
        loss = ranking.placed_loss(order, places, inside, ranking.target[piece])
        loss += LEFT_OUT * (~inside).sum(axis=1)
        lowest = np.flatnonzero((loss <= np.roll(loss, 1)) & (loss <= np.roll(loss, -1)))
        for number in lowest[np.argsort(loss[lowest], kind="stable")][:LAID]:
            matches = np.full(len(ranking.design), UNMATCHED, dtype=np.int64)
            matches[order[places[number, inside[number]]]] = piece[inside[number]]
            yield matches


def _positions(points: Floats, whole: int) -> Integers:
    """Place of each point along an evenly sampled curve, shape (k,), from 0: points may be missing or strays between.

    A curve of about ``whole`` steps that closes has exactly so many.
    """
    step = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    ratio = step / _local_medians(step, LOCAL)
    length = np.cumsum(np.where(ratio > STRAY_STEP, np.rint(ratio), ratio))
    scale = whole / length[-1] if whole and ratio[-1] < CLOSING and abs(length[-1] / whole - 1) < NEARLY_WHOLE else 1.0
    return np.rint(scale * np.append(0.0, length[:-1])).astype(np.int64)


@fused
def _local_medians(steps: Floats, reach: int) -> Floats:
    """Median of the steps up to ``reach`` places before and after each, shape (k,); repeated points make no step."""
    medians, near = np.empty(len(steps)), np.empty(2 * reach + 1)
    for k in range(len(steps)):
        count = 0
        for step in steps[max(k - reach, 0) : k + reach + 1]:
            if step == 0:
                continue
            place = count
            while place > 0 and near[place - 1] > step:
                near[place] = near[place - 1]
                place -= 1
            near[place] = step
            count += 1
        medians[k] = (near[(count - 1) // 2] + near[count // 2]) / 2 if count else 1.0
    return medians


def curve_order(following: Integers) -> tuple[Integers, bool]:
    """Indices along the one curve that all points sample, and whether it is closed; empty without such a curve."""
    starts = np.setdiff1d(np.arange(len(following)), following)
    if len(starts) > 1:
        return np.empty(0, dtype=np.int64), False
    order = [int(starts[0]) if len(starts) else 0]
    while len(order) < len(following):
        ahead = int(following[order[-1]])
        if ahead in (UNMATCHED, order[0]):
            return np.empty(0, dtype=np.int64), False
        order.append(ahead)
    return np.array(order), not len(starts)


def chains(following: Integers) -> list[tuple[Integers, bool]]:
    """Indices along each curve, and whether it is closed, from each point's next one."""
    visited = np.zeros(len(following), dtype=bool)
    starts = np.setdiff1d(np.arange(len(following)), following)
    curves = []
    for first in [*starts.tolist(), *range(len(following))]:
        if visited[first]:
            continue
        order, at = [], first
        while at != UNMATCHED and not visited[at]:
            visited[at] = True
            order.append(at)
            at = int(following[at])
        curves.append((np.array(order), at == first))
    return curves


def main_curve(points: Floats, curves: list[tuple[Integers, bool]]) -> tuple[Integers, bool]:
    """The one of `chains` that nearly all points sample, and whether it closes; empty without such a curve."""
    order, closed = max(curves, key=lambda curve: len(curve[0]))
    if len(order) < NEARLY_ALL * len(points):
        return np.empty(0, dtype=np.int64), False
    steps = np.linalg.norm(np.diff(points[order], axis=0), axis=1)
    gap = float(np.linalg.norm(points[order[0]] - points[order[-1]]))
    return order, closed or gap <= CLOSING * float(np.median(steps))


def _anticlockwise(points: Floats, order: Integers) -> Integers:
    x, y = points[order].T
    area = float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
    return order if area > 0 else order[::-1]


def _precision(field: SmoothField, rows: Integers) -> Floats:
    """Inverse covariance of partners without their affine part, shape (n, n)."""
    factor = field.factors[WIDTHS.index(0.9)][rows]
    covariance = AMPLITUDE**2 * factor @ factor.T + SIGMA**2 * np.eye(len(rows))
    span = np.column_stack([np.ones(len(rows)), field.points[rows]])
    inverse = np.linalg.inv(covariance)
    across = inverse @ span
    return np.asarray(inverse - across @ np.linalg.solve(span.T @ across, across.T))


def successors(points: Floats) -> Integers:
    """Index of the next point along the curve of each point, shape (n,), -1 at an end.

    Short edges join first, at most two at a point (the greedy heuristic of the travelling salesman).

    Examples
    --------
    >>> successors(np.column_stack([np.arange(4.0), np.zeros(4)])).tolist()
    [1, 2, 3, -1]
    """
    count = len(points)
    nearest = scipy.spatial.KDTree(points).query(points, k=min(NEIGHBOURS, count))
    length, index = np.asarray(nearest[0]), np.asarray(nearest[1])
    start = np.repeat(np.arange(count), length.shape[1] - 1)
    length, end = length[:, 1:].ravel(), index[:, 1:].ravel()
    short = (length < LONGEST * np.median(length[:: index.shape[1] - 1])) & (start != end)
    order = np.flatnonzero(short)[np.argsort(length[short], kind="stable")]
    return _directed(_joined(start[order], end[order], count))


@fused
def _joined(starts: Integers, ends: Integers, count: int) -> Integers:
    """The at most two points that each point is joined with by edges, the shortest first, shape (n, 2); -1 for none."""
    joined = np.full((count, 2), -1)
    pieces, size = np.arange(count), np.ones(count, dtype=np.int64)
    for edge in range(len(starts)):
        a, b = starts[edge], ends[edge]
        if joined[a, 1] >= 0 or joined[b, 1] >= 0 or b in joined[a]:
            continue
        here, there = _piece(pieces, a), _piece(pieces, b)
        if here != there:
            pieces[there] = here
            size[here] += size[there]
        elif size[here] < count / 4:
            continue  # only a large piece closes
        joined[a, int(joined[a, 0] >= 0)] = b
        joined[b, int(joined[b, 0] >= 0)] = a
    return joined


@fused
def _piece(pieces: Integers, point: int) -> int:
    """The number of a point's piece, in which each point but that one refers to another; the way gets shorter."""
    while pieces[point] != point:
        pieces[point] = pieces[pieces[point]]
        point = pieces[point]
    return point


@fused
def _directed(joined: Integers) -> Integers:
    """Index of each point's next one, shape (n,), from the points that it is joined with, shape (n, 2)."""
    following = np.full(len(joined), -1)
    visited = np.zeros(len(joined), dtype=np.bool_)
    for links in range(3):
        for start in range(len(joined)):
            if (joined[start] >= 0).sum() != links:
                continue
            at = start
            while not visited[at]:
                visited[at] = True
                here = at
                for number in joined[here, ::-1]:
                    if number >= 0 and not visited[number]:
                        at = number
                if at != here:
                    following[here] = at
                elif links == 2 and (joined[here] == start).any():
                    following[here] = start
    return following


def slid(matches: Integers, following: Integers, steps: int) -> Integers:
    """Matches after each point took the match of the point ``steps`` ahead; negative steps go back."""
    ahead = following
    if steps < 0:
        ahead = np.full(len(following), UNMATCHED)
        linked = np.flatnonzero(following != UNMATCHED)
        ahead[following[linked]] = linked
    partners = matches
    for _ in range(abs(steps)):
        partners = np.where(ahead == UNMATCHED, UNMATCHED, partners[ahead])
    return np.asarray(partners)
