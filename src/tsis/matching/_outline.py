"""Alignments of two outlines point by point: every start on a closed one, both directions of an open one.

Short edges join the points to curves, along which pairs slide by whole points. Where both sets sample one curve with
equally many points, all their alignments are few enough to be compared at once.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree

from tsis.matching._fit import UNMATCHED
from tsis.matching._pose_evidence import SIGMAS, WIDTHS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tsis.matching._fit import Floats, Integers
    from tsis.matching._pose_evidence import SmoothField
    from tsis.matching._refinement import Ranking

LIKELIEST = 24  # alignments that are returned, those first that are likelier than their neighbours
AMPLITUDE, SIGMA = 0.1, SIGMAS[1]  # of the field that ranks the alignments
MOST_POINTS = 400
NEIGHBOURS = 5
LONGEST = 3.0  # median distances of neighbours: a longer gap separates two curves
MOVED = 0.25  # root-mean-square radii
LEAST_PIECE, MOST_PIECES, LAID = 12, 3, 6  # points of a piece, number of pieces, and of places of each
LOCAL = 4  # steps on either side whose median is the step at a point
LEFT_OUT = 9 * (2 * SIGMAS[1]) ** 2  # loss of a point beyond the end of a curve: as of three standard deviations
STRAY_STEP = 0.7  # local steps, below which an edge leads to a stray point
NEARLY_WHOLE = 0.2  # largest deviation of the steps of a closed piece from those of the whole outline
NEARLY_ALL, CLOSING = 0.85, 5.0  # fraction of the points on the main curve; gap of a closed one, in median steps


def outline_alignments(field: SmoothField, target: Floats) -> list[Integers]:
    """The likeliest matches, shape (n,) each, that keep the order of points; none where the sets are no such curves."""
    source = field.points
    if source.shape[1] != 2 or len(source) != len(target) or len(source) > MOST_POINTS:
        return []
    here, closed_here = curve_order(source)
    there, closed_there = curve_order(target)
    if not len(here) or not len(there) or closed_here != closed_there:
        return []
    if closed_here:
        here, there = _anticlockwise(source, here), _anticlockwise(target, there)
        shifts = np.arange(len(there))[:, None] + np.arange(len(there))
        orders = there[shifts % len(there)]
    else:
        orders = np.stack([there, there[::-1]])
    precision = _precision(field, here)
    loss = np.einsum("sid,ij,sjd->s", target[orders], precision, target[orders], optimize=True)
    lowest = (loss <= np.roll(loss, 1)) & (loss <= np.roll(loss, -1))
    alignments = []
    for number in np.lexsort((loss, ~lowest))[:LIKELIEST]:
        matches = np.full(len(source), UNMATCHED, dtype=np.int64)
        matches[here] = orders[number]
        alignments.append(matches)
    return alignments


def self_resemblance(field: SmoothField, outline: tuple[Integers, bool]) -> float:
    """Least loss of an alignment of the outline, a `main_curve`, with itself that moves it by more than `MOVED`.

    It is about zero for a shape with a symmetry, and infinite where the source is no single curve.
    """
    points = field.points
    if points.shape[1] != 2 or len(points) > MOST_POINTS:
        return math.inf
    order, closed = outline
    if not len(order):
        return math.inf
    along = points[order]
    if closed:
        shifts = np.arange(len(order))[:, None] + np.arange(len(order))
        aligned = along[shifts % len(order)]
    else:
        aligned = np.stack([along, along[::-1]])
    far = np.sqrt(((aligned - along) ** 2).sum(axis=2).mean(axis=1)) > MOVED
    if not far.any():
        return math.inf
    precision = _precision(field, order)
    return float(np.einsum("sid,ij,sjd->s", aligned[far], precision, aligned[far], optimize=True).min())


def laid_pieces(curve: tuple[Integers, bool], ranking: Ranking, following: Integers) -> Iterator[Integers]:
    """Matches, shape (n,), of pieces of the target's curves laid on each place of a curve of the source.

    ``following`` has each target point's next one. Of each piece the places come that fit better than their neighbours,
    the likeliest first. Points beyond the end of an open curve have no match.
    """
    order, closed = curve
    count = len(order)
    if not LEAST_PIECE <= count <= MOST_POINTS:
        return
    design = ranking.design[order]
    long = sorted((piece for piece, _ in chains(following) if len(piece) >= LEAST_PIECE), key=len, reverse=True)
    for piece in (part for whole in long[:MOST_PIECES] for part in (whole, whole[::-1])):
        position = _positions(ranking.target[piece], count if closed else 0)
        first = 0 if closed else LEAST_PIECE - 1 - position[-1]
        places = position + np.arange(first, count if closed else count - LEAST_PIECE + 1)[:, None]
        inside = position < count if closed else (places >= 0) & (places < count)
        inside = np.broadcast_to(inside, places.shape)
        places %= count
        loss = _laid_loss(ranking, design[places] * inside[..., None], ranking.target[piece] * inside[..., None])
        loss += LEFT_OUT * (~inside).sum(axis=1)
        lowest = np.flatnonzero((loss <= np.roll(loss, 1)) & (loss <= np.roll(loss, -1)))
        for number in lowest[np.argsort(loss[lowest], kind="stable")][:LAID]:
            matches = np.full(len(ranking.design), UNMATCHED, dtype=np.int64)
            matches[order[places[number, inside[number]]]] = piece[inside[number]]
            yield matches


def _laid_loss(ranking: Ranking, design: Floats, goal: Floats) -> Floats:
    """Loss, shape (s,), of pairs of columns, shape (s, l, k), with points, shape (s, l, d)."""
    across = design.transpose(0, 2, 1)
    return ranking.loss(across @ design, across @ goal, goal)


def _positions(points: Floats, whole: int) -> Integers:
    """Place of each point along an evenly sampled curve, shape (k,), from 0: points may be missing or strays between.

    A curve of about ``whole`` steps that closes has exactly so many.
    """
    step = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    near = np.array([np.median(step[max(k - LOCAL, 0) : k + LOCAL + 1]) for k in range(len(step))])
    ratio = step / near
    length = np.cumsum(np.where(ratio > STRAY_STEP, np.rint(ratio), ratio))
    scale = whole / length[-1] if whole and ratio[-1] < CLOSING and abs(length[-1] / whole - 1) < NEARLY_WHOLE else 1.0
    return np.rint(scale * np.append(0.0, length[:-1])).astype(np.int64)


def curve_order(points: Floats) -> tuple[Integers, bool]:
    """Indices along the one curve that all points sample, and whether it is closed; empty without such a curve."""
    following = successors(points)
    starts = np.setdiff1d(np.arange(len(points)), following)
    if len(starts) > 1:
        return np.empty(0, dtype=np.int64), False
    order = [int(starts[0]) if len(starts) else 0]
    while len(order) < len(points):
        ahead = int(following[order[-1]])
        if ahead in (UNMATCHED, order[0]):
            return np.empty(0, dtype=np.int64), False
        order.append(ahead)
    return np.array(order), not len(starts)


def chains(following: Integers) -> list[tuple[Integers, bool]]:
    """Indices along each curve, and whether it is closed, from each point's next one."""
    visited = np.zeros(len(following), dtype=bool)
    starts = np.setdiff1d(np.arange(len(following)), following)
    result = []
    for first in [*starts.tolist(), *range(len(following))]:
        if visited[first]:
            continue
        order, at = [], first
        while at != UNMATCHED and not visited[at]:
            visited[at] = True
            order.append(at)
            at = int(following[at])
        result.append((np.array(order), at == first))
    return result


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
    nearest = KDTree(points).query(points, k=min(NEIGHBOURS, count))
    length, index = np.asarray(nearest[0]), np.asarray(nearest[1])
    start = np.repeat(np.arange(count), length.shape[1] - 1)
    length, end = length[:, 1:].ravel(), index[:, 1:].ravel()
    short = (length < LONGEST * np.median(length[:: index.shape[1] - 1])) & (start != end)
    order = np.flatnonzero(short)[np.argsort(length[short], kind="stable")]
    joined: list[list[int]] = [[] for _ in range(count)]
    piece = list(range(count))
    members = [[number] for number in range(count)]
    for a, b in zip(start[order].tolist(), end[order].tolist(), strict=True):
        if len(joined[a]) > 1 or len(joined[b]) > 1 or b in joined[a]:
            continue
        if piece[a] == piece[b]:
            if len(members[piece[a]]) < count / 4:
                continue  # only a large piece closes
        else:
            here, there = piece[a], piece[b]
            for member in members[there]:
                piece[member] = here
            members[here] += members[there]
        joined[a].append(b)
        joined[b].append(a)
    return _directed(joined)


def _directed(joined: list[list[int]]) -> Integers:
    following = np.full(len(joined), UNMATCHED, dtype=np.int64)
    visited = np.zeros(len(joined), dtype=bool)
    ends = sorted(range(len(joined)), key=lambda number: len(joined[number]))
    for start in ends:
        at = start
        while not visited[at]:
            visited[at] = True
            ahead = [number for number in joined[at] if not visited[number]]
            if ahead:
                following[at] = ahead[0]
                at = ahead[0]
            elif start in joined[at] and len(joined[start]) > 1:
                following[at] = start
    return following


def slid(matches: Integers, following: Integers, steps: int) -> Integers:
    """Matches after each point took the match of the point ``steps`` ahead; negative steps go back."""
    ahead = following
    if steps < 0:
        ahead = np.full(len(following), UNMATCHED)
        linked = np.flatnonzero(following != UNMATCHED)
        ahead[following[linked]] = linked
    result = matches
    for _ in range(abs(steps)):
        result = np.where(ahead == UNMATCHED, UNMATCHED, result[ahead])
    return np.asarray(result)
