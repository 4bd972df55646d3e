"""Which spot is which dot of a square board: rows and columns for spots in any order, with gaps and strays."""

from __future__ import annotations

import heapq
import itertools
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

NEAREST = 12  # neighbours among which a dot's two steps are sought
MISS = 0.3  # largest distance of a dot from its predicted place, in steps; a wide-angle lens changes steps by a fifth
STARTS = 8  # dots that are tried as the first one
ENOUGH = 0.95  # share of the spots at which the search for a better first dot ends, if dots
MORE = 1.2  # times as many links as found before, to be taken instead
DENSE = 1.2  # links each to neighbours: 2 on an endless board without gaps


def index_lattice(places_px: NDArray[np.float64]) -> NDArray[np.int64]:
    """Give each spot its place on a lattice.

    From a first dot the lattice grows to the neighbour that lies nearest to its predicted place, with steps that follow
    the picture's distortion; a missing dot is stepped over. The growth begins at dots whose
    steps are those of most others; of several the one with clearly most pairs of neighbours wins.

    Parameters
    ----------
    places_px
        Centres (x, y), shape (n, 2), pixels.

    Returns
    -------
    ndarray
        Row number of the spot, and its place on the lattice: columns (spot, i, j), one row for each spot that
        belongs to it; shape (0, 3) when no two steps repeat anywhere. Which of the lattice's axes is i is arbitrary.

    Examples
    --------
    >>> j, i = np.mgrid[:3, :4]
    >>> places = np.stack([50.0 * i.ravel(), 50.0 * j.ravel()], axis=1)
    >>> index_lattice(places).shape
    (12, 3)
    """
    best = np.empty((0, 3), dtype=np.int64)
    if len(places_px) < 4:
        return best
    tree = cKDTree(places_px)
    starts = [(first, _first_steps(places_px, tree, first)) for first in range(len(places_px))]
    known = [(first, steps) for first, steps in starts if steps is not None]
    if not known:
        return best
    # Steps that most dots have come first: beside gaps a diagonal is taken for a step, beside a stray spot half a step.
    steps_of = np.array([steps for _, steps in known])
    most = 0
    for place in np.argsort(-_alike(steps_of), kind="stable")[:STARTS]:
        found = _grown(places_px, tree, known[place][0], known[place][1])
        links = _link_count(found)
        if links > MORE * most:
            best, most = found, links
        if len(best) >= ENOUGH * len(places_px) and most >= DENSE * len(best):
            break
    return best


def _first_steps(
    places: NDArray[np.float64], tree: cKDTree, first: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """The two shortest steps, not nearly parallel, that lead from a dot to others both forwards and backwards."""
    near = np.asarray(tree.query(places[first], k=min(NEAREST + 1, len(places)))[1])
    ways = places[near[1:]] - places[first]
    forth_and_back = [
        way
        for way in ways
        if np.linalg.norm(ways + way, axis=1).min() < MISS * np.linalg.norm(way)
        and (way[0], way[1]) > (-way[0], -way[1])
    ]
    for one, other in sorted(itertools.combinations(forth_and_back, 2), key=_length):
        turn = one[0] * other[1] - one[1] * other[0]
        if abs(turn) > 0.5 * np.linalg.norm(one) * np.linalg.norm(other):
            return one, other
    return None


def _alike(steps: NDArray[np.float64]) -> NDArray[np.int64]:
    """How many pairs of steps are like each of the pairs, shape (n,), from pairs of shape (n, 2, 2)."""
    straight = np.linalg.norm(steps[:, None] - steps[None], axis=3).max(axis=2)
    crossed = np.linalg.norm(steps[:, None] - steps[None, :, ::-1], axis=3).max(axis=2)
    shorter = np.linalg.norm(steps, axis=2).min(axis=1)
    return np.asarray((np.minimum(straight, crossed) < MISS / 2 * shorter[:, None]).sum(axis=1))


def _link_count(rows: NDArray[np.int64]) -> int:
    """Pairs of neighbours on the lattice."""
    cells = {(int(i), int(j)) for _, i, j in rows}
    return sum(((i + 1, j) in cells) + ((i, j + 1) in cells) for i, j in cells)


def _length(steps: tuple[NDArray[np.float64], NDArray[np.float64]]) -> float:
    return float(np.linalg.norm(steps, axis=1).sum())


def _grown(
    places: NDArray[np.float64],
    tree: cKDTree,
    first: int,
    steps: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> NDArray[np.int64]:
    spot_at = {(0, 0): first}
    cell_of = {first: (0, 0)}
    waiting = list(_links(places, tree, first, steps))
    heapq.heapify(waiting)
    while waiting:
        _, start, axis, reach, spot = heapq.heappop(waiting)
        i, j = cell_of[start]
        cell = (i + reach, j) if axis == 0 else (i, j + reach)
        if spot in cell_of or cell in spot_at:
            continue
        spot_at[cell], cell_of[spot] = spot, cell
        measured = _measured_steps(places, cell, spot_at, steps)
        for link in _links(places, tree, spot, measured):
            heapq.heappush(waiting, link)
    return np.array([(spot, i, j) for (i, j), spot in spot_at.items()], dtype=np.int64)


def _links(
    places: NDArray[np.float64], tree: cKDTree, start: int, steps: tuple[NDArray[np.float64], NDArray[np.float64]]
) -> Iterator[tuple[float, int, int, int, int]]:
    """Spots near the places that steps from a dot lead to: (how badly, start, axis, steps, spot)."""
    for axis, reach in itertools.product((0, 1), (1, -1, 2, -2)):
        distance, spot = tree.query(places[start] + reach * steps[axis])
        miss = float(distance / np.linalg.norm(steps[axis]))
        if miss < MISS:
            # Two steps at once only where nothing is left to reach with one.
            yield miss + (abs(reach) - 1), start, axis, reach, int(spot)


def _measured_steps(
    places: NDArray[np.float64],
    cell: tuple[int, int],
    spot_at: dict[tuple[int, int], int],
    first: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The steps about a dot: medians of those known between the dots around it, each axis for itself."""
    found = []
    for axis, default in enumerate(first):
        known = list(_known_steps(places, cell, spot_at, axis))
        found.append(np.median(known, axis=0) if known else default)
    return found[0], found[1]


def _known_steps(
    places: NDArray[np.float64], cell: tuple[int, int], spot_at: dict[tuple[int, int], int], axis: int
) -> Iterator[NDArray[np.float64]]:
    for di, dj in itertools.product(range(-2, 3), repeat=2):
        low = (cell[0] + di, cell[1] + dj)
        high = (low[0] + 1, low[1]) if axis == 0 else (low[0], low[1] + 1)
        if low in spot_at and high in spot_at:
            yield places[spot_at[high]] - places[spot_at[low]]
