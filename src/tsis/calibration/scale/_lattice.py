"""Lattice coordinates of spots, and the two lattice directions that are the board's rows and columns."""

from __future__ import annotations

import heapq
import itertools
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.calibration.scale._board_map import BoardMap, fit_map
from tsis.errors import CalibrationError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray


MOST_SKEW_DEG = 3.0  # between the image's axes on the board; noise and scatter cause some tenths
# Height over width of a pixel; a hexagonal board or one with every second row missing gives 0.58 or 0.5 times that.
PIXEL_RATIO = (0.8, 1.25)
LONGEST_PIXEL = 2.5  # ratio of the sides up to which a lattice of two pitches is recognised for the error message
CLEAR_SKEW_DEG = 4.0  # by which the best pair of lattice axes must be squarer than the second
# Pairs of axes that describe the same lattice; the first dots may have had gaps as neighbours.
WAYS = [(i, j) for i in range(3) for j in range(-2, 3) if i > 0 or j > 0]
AXES = [
    np.array(pair)
    for pair in itertools.combinations(WAYS, 2)
    if abs(pair[0][0] * pair[1][1] - pair[0][1] * pair[1][0]) == 1
]


def with_square_axes(fitted: BoardMap, cell: NDArray[np.float64]) -> BoardMap:
    """The same dots along the two lattice axes that make the image's axes perpendicular on the face.

    Where pixels are far from square, the diagonal of a rotated board may be shorter in the image than its side. A
    square lattice at 32 degrees along a diagonal is again square, with pixels 2.6 times as long as wide, which no
    camera has.
    """
    step = fitted.face_step(cell)
    skews = np.array([abs(skew_deg(axes @ step)) for axes in AXES])
    width, height = np.array([np.linalg.norm(axes @ step, axis=0) for axes in AXES]).T
    ratios = height / width
    usual = (ratios > PIXEL_RATIO[0]) & (ratios < PIXEL_RATIO[1])
    first, second = np.argsort(np.where(usual, skews, 90.0))[:2]
    if not usual[first] or skews[first] > MOST_SKEW_DEG:
        raise _no_square(skews, ratios, usual)
    if usual[second] and skews[second] - skews[first] < CLEAR_SKEW_DEG:
        raise CalibrationError(
            f"the dots' rows must differ from their diagonals; both fit a square lattice to {skews[second]:.0f} "
            "degrees (lay the rows along the image's axes)"
        )
    axes = AXES[first]
    if abs((axes @ step)[0, 0]) < abs((axes @ step)[1, 0]):
        axes = axes[::-1]
    # Count along the image's axes as nearly as possible: the rotation then has a sign.
    axes = axes * np.sign(np.diag(axes @ step))[:, None]
    return fit_map(fitted.cells @ axes.T, fitted.positions_px)


def _no_square(skews: NDArray[np.float64], ratios: NDArray[np.float64], usual: NDArray[np.bool]) -> CalibrationError:
    """Explain why no pair of lattice axes gives the pixels of a camera."""
    long = (ratios < LONGEST_PIXEL) & (ratios > 1 / LONGEST_PIXEL)
    squarest = int(np.argmin(np.where(long, skews, 90.0)))
    if long[squarest] and skews[squarest] <= MOST_SKEW_DEG:
        return CalibrationError(
            "the board's rows and columns must be one pitch apart, with no row missing throughout; they would make a "
            f"pixel {ratios[squarest]:.2f} times as high as wide, and cameras' pixels are {PIXEL_RATIO[0]:g} to "
            f"{PIXEL_RATIO[1]:g} (use a board of dots on a square lattice, not a hexagonal one)"
        )
    skew = float(np.where(usual, skews, 90.0).min() if usual.any() else skews.min())
    return CalibrationError(
        f"the dots must form a square lattice seen straight on, to {MOST_SKEW_DEG:g} degrees; theirs is {skew:.1f} "
        "degrees askew (use a board with one pitch along both axes and square rows, and press it without tilt)"
    )


def rotation_deg(step: NDArray[np.float64]) -> float:
    """Angle in the image from the x axis towards the y axis to the nearest lattice axis, in [-45, 45]."""
    angle = -float(np.degrees(np.arctan2(step[1, 0], step[0, 0])))
    return (angle + 45.0) % 90.0 - 45.0


def skew_deg(step: NDArray[np.float64]) -> float:
    """Departure of the image's two axes from a right angle on the face."""
    x, y = step.T
    sine = (x @ y) / (np.linalg.norm(x) * np.linalg.norm(y))
    return float(np.degrees(np.arcsin(np.clip(sine, -1.0, 1.0))))


NEAREST = 12  # neighbours in the search for a dot's two steps
MISS = 0.3  # largest distance of a dot from its prediction, in steps; a wide-angle lens changes steps by a fifth
STARTS = 8  # dots tried as the first one
ENOUGH = 0.95  # fraction of the spots on the lattice that ends the search for a better first dot
MORE = 1.2  # required factor of links over the best lattice so far
DENSE = 1.2  # links each to neighbours: 2 on an endless board without gaps


def index_lattice(positions_px: NDArray[np.float64]) -> NDArray[np.int64]:
    """Row number and lattice position (spot, i, j) of each spot of the lattice; (0, 3) when no two steps repeat.

    From a first dot the lattice grows to the neighbour nearest to its prediction, with steps that follow the image's
    distortion; a missing dot is skipped. Growth begins at the dots with the most common steps; the lattice with
    clearly the most pairs of neighbours wins. The order of the lattice's axes is arbitrary.

    Examples
    --------
    >>> j, i = np.mgrid[:3, :4]
    >>> index_lattice(np.stack([50.0 * i.ravel(), 50.0 * j.ravel()], axis=1)).shape
    (12, 3)
    """
    best = np.empty((0, 3), dtype=np.int64)
    if len(positions_px) < 4:
        return best
    tree = scipy.spatial.cKDTree(positions_px)
    starts = [(first, _first_steps(positions_px, tree, first)) for first in range(len(positions_px))]
    existing = [(first, steps) for first, steps in starts if steps is not None]
    if not existing:
        return best
    # The most common steps come first: beside gaps a diagonal looks like a step, beside a stray spot half a step.
    steps_of = np.array([steps for _, steps in existing])
    most = 0
    for position in np.argsort(-_same_lattice(steps_of), kind="stable")[:STARTS]:
        lattice = _grown(positions_px, tree, existing[position][0], existing[position][1])
        links = _link_count(lattice)
        if links > MORE * most:
            best, most = lattice, links
        if len(best) >= ENOUGH * len(positions_px) and most >= DENSE * len(best):
            break
    return best


def _first_steps(
    positions: NDArray[np.float64], tree: scipy.spatial.cKDTree, first: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """The two shortest steps, not nearly parallel, that have dots at both ends."""
    near = np.asarray(tree.query(positions[first], k=min(NEAREST + 1, len(positions)))[1])
    ways = positions[near[1:]] - positions[first]
    forth_and_back = [
        way
        for way in ways
        if np.linalg.norm(ways + way, axis=1).min() < MISS * np.linalg.norm(way)
        and (way[0], way[1]) > (-way[0], -way[1])
    ]
    pairs = itertools.combinations(forth_and_back, 2)
    for first_way, second_way in sorted(pairs, key=lambda pair: float(np.linalg.norm(pair, axis=1).sum())):
        area = first_way[0] * second_way[1] - first_way[1] * second_way[0]
        if abs(area) > 0.5 * np.linalg.norm(first_way) * np.linalg.norm(second_way):
            return first_way, second_way
    return None


def _same_lattice(steps: NDArray[np.float64]) -> NDArray[np.int64]:
    """Number of similar pairs of steps for each pair, shape (n,), from pairs of shape (n, 2, 2)."""
    straight = np.linalg.norm(steps[:, None] - steps[None], axis=3).max(axis=2)
    crossed = np.linalg.norm(steps[:, None] - steps[None, :, ::-1], axis=3).max(axis=2)
    shorter = np.linalg.norm(steps, axis=2).min(axis=1)
    return np.asarray((np.minimum(straight, crossed) < MISS / 2 * shorter[:, None]).sum(axis=1))


def _link_count(rows: NDArray[np.int64]) -> int:
    """Pairs of neighbours on the lattice."""
    cells = {(int(i), int(j)) for _, i, j in rows}
    return sum(((i + 1, j) in cells) + ((i, j + 1) in cells) for i, j in cells)


def _grown(
    positions: NDArray[np.float64],
    tree: scipy.spatial.cKDTree,
    first: int,
    steps: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> NDArray[np.int64]:
    spot_at = {(0, 0): first}
    cell_of = {first: (0, 0)}
    waiting = list(_links(positions, tree, first, steps))
    heapq.heapify(waiting)
    while waiting:
        _, start, axis, extent, spot = heapq.heappop(waiting)
        i, j = cell_of[start]
        cell = (i + extent, j) if axis == 0 else (i, j + extent)
        if spot in cell_of or cell in spot_at:
            continue
        spot_at[cell], cell_of[spot] = spot, cell
        measured = _measured_steps(positions, cell, spot_at, steps)
        for link in _links(positions, tree, spot, measured):
            heapq.heappush(waiting, link)
    return np.array([(spot, i, j) for (i, j), spot in spot_at.items()], dtype=np.int64)


def _links(
    positions: NDArray[np.float64],
    tree: scipy.spatial.cKDTree,
    start: int,
    steps: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> Iterator[tuple[float, int, int, int, int]]:
    """Spots near the predictions from a dot: (relative miss, start, axis, steps, spot)."""
    for axis, extent in itertools.product((0, 1), (1, -1, 2, -2)):
        distance, spot = tree.query(positions[start] + extent * steps[axis])
        miss = float(distance / np.linalg.norm(steps[axis]))
        if miss < MISS:
            # Double steps only after all single steps.
            yield miss + (abs(extent) - 1), start, axis, extent, int(spot)


def _measured_steps(
    positions: NDArray[np.float64],
    cell: tuple[int, int],
    spot_at: dict[tuple[int, int], int],
    first: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The steps about a dot: medians over the pairs around it, each axis separately."""
    medians = []
    for axis, default in enumerate(first):
        steps = list(_steps_around(positions, cell, spot_at, axis))
        medians.append(np.median(steps, axis=0) if steps else default)
    return medians[0], medians[1]


def _steps_around(
    positions: NDArray[np.float64], cell: tuple[int, int], spot_at: dict[tuple[int, int], int], axis: int
) -> Iterator[NDArray[np.float64]]:
    for di, dj in itertools.product(range(-2, 3), repeat=2):
        low = (cell[0] + di, cell[1] + dj)
        high = (low[0] + 1, low[1]) if axis == 0 else (low[0], low[1] + 1)
        if low in spot_at and high in spot_at:
            yield positions[spot_at[high]] - positions[spot_at[low]]
