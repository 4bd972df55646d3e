"""Order of points along the curves that they sample, to slide one curve along another by whole points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree

from tsis.matching._fit import UNMATCHED

if TYPE_CHECKING:
    from tsis.matching._fit import Floats, Integers

NEIGHBOURS = 5
LONGEST = 3.0  # median distances of neighbours: a longer gap separates two curves


def successors(points: Floats) -> Integers:
    """Index of the next point along the curve of each point, shape (n,), -1 at an end.

    Short edges join first, at most two at a point (the greedy heuristic of the travelling salesman).

    Examples
    --------
    >>> successors(np.column_stack([np.arange(4.0), np.zeros(4)])).tolist()
    [1, 2, 3, -1]
    """
    count = len(points)
    length, index = KDTree(points).query(points, k=min(NEIGHBOURS, count))
    start = np.repeat(np.arange(count), length.shape[1] - 1)
    length, end = length[:, 1:].ravel(), index[:, 1:].ravel()
    short = (length <= LONGEST * np.median(length[:: index.shape[1] - 1])) & (start != end)
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
    seen = np.zeros(len(joined), dtype=bool)
    ends = sorted(range(len(joined)), key=lambda number: len(joined[number]))
    for start in ends:
        at = start
        while not seen[at]:
            seen[at] = True
            ahead = [number for number in joined[at] if not seen[number]]
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
