"""Adaptive grid of a density on a sheared box with a support."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import scipy

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.inclusion.prior import Booleans, Floats, Integers

    Support = Callable[[Floats], Booleans]
    LogDensity = Callable[[Floats], Floats]
    SlantedBox = tuple[Floats, Floats]  # a corner, and its edges as rows


@cache
def _lattice(per_axis: int, *, ends: bool) -> Floats:
    """Points of a regular lattice in the cube [-1/2, 1/2]**3, with its faces or without, shape (per_axis**3, 3)."""
    steps = np.linspace(-0.5, 0.5, per_axis) if ends else (np.arange(per_axis) + 0.5) / per_axis - 0.5
    points = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
    points.flags.writeable = False
    return points


CORNERS = 8  # of a cell
INNER = _lattice(4, ends=False)
INNER_AND_ENDS = _lattice(5, ends=True)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GridCells:
    """Cells of a sheared box that are at least partly inside the support."""

    centre: Floats  # centres of the cells, shape (n, 3)
    edges: Floats  # edge vectors of a cell as rows, shape (3, 3)
    points: Floats  # centroids of the parts inside, shape (n, 3)
    fraction: Floats  # volume fraction of each cell inside, shape (n,), in (0, 1]


def cells_of(origin: Floats, axes: Floats, per_axis: int, support: Support) -> GridCells:
    """Cells of the box spanned by the rows of ``axes``, without those outside the support."""
    centre = origin + (_lattice(per_axis, ends=False) + 0.5) @ axes
    edges = axes / per_axis
    if support(origin + (INNER_AND_ENDS + 0.5) @ axes).all():  # a nearly convex region contains all cells
        return GridCells(centre=centre, edges=edges, points=centre, fraction=np.ones(len(centre)))
    corners = _corners_inside(origin, axes, per_axis, support)
    centre, corners = centre[corners > 0], corners[corners > 0]
    points, fraction = centre.copy(), np.ones(len(centre))
    cut = corners < CORNERS
    inner = centre[cut][:, None] + INNER @ edges
    inside = support(inner.reshape(-1, 3)).reshape(-1, len(INNER)).astype(float)
    count = inside.sum(axis=1)
    fraction[cut] = count / len(INNER)
    points[cut] += (inside / np.maximum(count, 1.0)[:, None]) @ INNER @ edges
    some = fraction > 0
    return GridCells(centre=centre[some], edges=edges, points=points[some], fraction=fraction[some])


def _corners_inside(origin: Floats, axes: Floats, per_axis: int, support: Support) -> Integers:
    """Number of corners of each cell inside the support, shape (cells,)."""
    vertices = support(origin + (_lattice(per_axis + 1, ends=True) + 0.5) @ axes)
    cube = vertices.reshape(3 * (per_axis + 1,)).astype(np.int64)
    for axis in range(3):
        low, high = (np.take(cube, range(start, start + per_axis), axis=axis) for start in (0, 1))
        cube = low + high
    return cube.ravel()


ENOUGH_FRACTION = 0.04  # of the cells: number that a refinement step leaves; fewer alias thin slanted densities
NEGLIGIBLE = np.log(1e-7)  # log weight, relative to the best cell, that the next grid may leave out
FAINT = np.log(1e-2)  # the same after tempering: the density itself is far smaller there
STEPS = 40
FEWEST = 12  # least cells along an axis for a density anywhere in the box
WIDER = 2.0  # factor on the box of a similar density
STUCK = 0.7  # of the volume: a box that shrinks less gets more cells instead
TRIES = 16  # draws from a cell at the edge before its centroid is taken
ELSEWHERE = np.array([0.8191725134, 0.6710436067, 0.5497004779])  # Kronecker sequence that fills a cube evenly


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Grid:
    """Cells of a density."""

    cells: GridCells  # the cells in which it is not negligible
    log_density: Floats  # log density at their points, shape (n,)
    support: Support  # mask function of its support

    @property
    def weight(self) -> Floats:
        """Probability of each cell, shape (n,)."""
        weight = self.cells.fraction * np.exp(self.log_density - self.log_density.max())
        return np.asarray(weight / weight.sum())

    @property
    def log_integral(self) -> float:
        """Log of the integral of the density over all cells."""
        most = float(self.log_density.max())
        total = float((self.cells.fraction * np.exp(self.log_density - most)).sum())
        return most + float(np.log(total * abs(np.linalg.det(self.cells.edges))))

    def with_density(self, log_density: Floats) -> Grid:
        """The same cells under another density."""
        return replace(self, log_density=log_density)

    def mean(self) -> Floats:
        """Weighted mean of the points, shape (3,)."""
        return np.asarray(self.weight @ self.cells.points)

    def samples(self, count: int) -> Floats:
        """``count`` equally weighted samples by a Sobol sequence, shape (count, 3): deterministic."""
        unit = scipy.stats.qmc.Sobol(4, scramble=False).random_base2(int(np.ceil(np.log2(count))))[:count] + 0.5 / count
        chosen = np.minimum(np.searchsorted(np.cumsum(self.weight), unit[:, 0] % 1.0), len(self.weight) - 1)
        position, centre = unit[:, 1:], self.cells.centre[chosen]
        for _ in range(TRIES):
            drawn = centre + (position % 1.0 - 0.5) @ self.cells.edges
            inside = self.support(drawn)
            if inside.all():
                return drawn
            position = np.where(inside[:, None], position, position + ELSEWHERE)
        return np.where(inside[:, None], drawn, self.cells.points[chosen])


def refine(
    log_density: LogDensity,
    low: Floats,
    high: Floats,
    *,
    support: Support | None = None,
    per_axis: int = 16,
    finder: int = 16,
    near: SlantedBox | None = None,
    finest: int = 2,
) -> Grid:
    """Refine a grid on the box [low, high], which contains all of a density, until it resolves the density.

    ``log_density``, up to a constant, of points (n, 3) is called once a refinement. ``support`` masks points with
    density, a convex region; the box when None. The result has ``per_axis`` cells along each axis, for a curved density
    in a wide box up to ``finest`` times as many. Search grids have ``finder`` cells, at least `FEWEST` without
    ``near``, the box of a similar density, which is searched first.
    """
    if support is None:

        def support(points: Floats) -> Booleans:
            return np.asarray(((points >= low) & (points <= high)).all(axis=1))

    def evaluate(box: SlantedBox, count: int) -> _CoarseDensity:
        cells = cells_of(*box, count, support)
        return _CoarseDensity(box=box, per_axis=count, cells=cells, log_density=log_density(cells.points))

    start = None if near is None else evaluate(near, finder)
    if start is None or not start.holds:
        start = evaluate((low, np.diag(high - low)), max(finder, FEWEST))
    last = evaluate(*_find(evaluate, start, (low, high), (per_axis, finest * per_axis)))
    return Grid(cells=last.cells, log_density=last.log_density, support=support)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _CoarseDensity:
    """A density in the cells of a box."""

    box: SlantedBox
    per_axis: int
    cells: GridCells
    log_density: Floats

    @property
    def log_weight(self) -> Floats:
        """Log probability of each cell over the largest."""
        weight = self.log_density + np.log(self.cells.fraction)
        return np.asarray(weight - weight.max())

    @property
    def holds(self) -> bool:
        """Whether the density is faint at the box's ends, except at the ends of its support."""
        if not len(self.cells.centre):
            return False
        origin, axes = self.box
        position = (self.cells.centre - origin) @ np.linalg.inv(axes)
        outermost = (np.abs(position - 0.5) > 0.5 - 1 / self.per_axis).any(axis=1) & (self.cells.fraction == 1.0)
        return not outermost.any() or float(self.log_weight[outermost].max()) < FAINT


def box_around(points: Floats, log_density: Floats, edges: Floats) -> SlantedBox:
    """A sheared box with a margin around a density at points (n, 3), the centres of cells with the given edges."""
    middle, shear, first, last = _sheared(points, edges, log_density - log_density.max(), 1.0)
    first, last = (first + last) / 2 - WIDER * (last - first) / 2, (first + last) / 2 + WIDER * (last - first) / 2
    return middle + shear @ first, (shear * (last - first)).T


def _find(
    view: Callable[[SlantedBox, int], _CoarseDensity],
    coarse: _CoarseDensity,
    ends: tuple[Floats, Floats],
    counts: tuple[int, int],
) -> tuple[SlantedBox, int]:
    """The tight box of a density, and cells along its axes; ``counts`` are the requested and the most."""
    (fine, most), per_axis = counts, coarse.per_axis
    resolved = False
    for _ in range(STEPS):
        log_weight = coarse.log_weight
        power = _temper(log_weight, min(ENOUGH_FRACTION * per_axis**3, len(log_weight) / 2))
        box = _sheared_box(coarse.cells, log_weight, power, *ends)
        # The last tempered grid is too wide for the density itself: one more at temperature one.
        if resolved and power == 1.0:
            break
        resolved = power == 1.0
        if power < 1.0 and abs(np.linalg.det(box[1])) > STUCK * abs(np.linalg.det(coarse.box[1])):
            if per_axis >= most:
                break
            per_axis = min(3 * per_axis // 2, most)
        coarse = view(box, per_axis)
    return box, max(per_axis, fine)


def _temper(log_weight: Floats, enough: float) -> float:
    """Largest power of the density, at most one, at which the effective number of cells is ``enough``."""

    def excess(log_power: float) -> float:
        weight = np.exp(log_weight * np.exp(log_power))
        return float(weight.sum() ** 2 / (weight**2).sum()) - enough

    return 1.0 if excess(0.0) >= 0 else float(np.exp(scipy.optimize.brentq(excess, -30.0, 0.0, xtol=1e-2)))


def _sheared_box(cells: GridCells, log_weight: Floats, power: float, low: Floats, high: Floats) -> SlantedBox:
    """A box around all cells of weight, sheared along the tempered points, that ends at the last coordinate's ends."""
    middle, shear, first, last = _sheared(cells.points, cells.edges, log_weight, power)
    inverse = np.linalg.inv(shear)
    first[2] = max(first[2], (low[2] - middle[2]) * inverse[2, 2])
    last[2] = min(last[2], (high[2] - middle[2]) * inverse[2, 2])
    return middle + shear @ first, (shear * (last - first)).T


def _sheared(points: Floats, edges: Floats, log_weight: Floats, power: float) -> tuple[Floats, Floats, Floats, Floats]:
    """Mean and triangular root of the covariance of tempered points, and the ends of all weight in its units."""
    weight = np.exp(power * log_weight)
    weight /= weight.sum()
    middle = weight @ points
    centred = points - middle
    shear = _shear((weight[:, None] * centred).T @ centred + edges.T @ edges / 12)
    inverse = np.linalg.inv(shear)
    along = centred[log_weight > min(NEGLIGIBLE, FAINT / power)] @ inverse.T
    margin = np.abs(edges @ inverse.T).sum(axis=0) / 2
    return middle, shear, along.min(axis=0) - margin, along.max(axis=0) + margin


def _shear(covariance: Floats) -> Floats:
    """Triangular root of a covariance, with the last coordinate first.

    Its range is never tilted, so that a flat posterior has exactly the prior's ends.
    """
    lead = np.ix_([2, 1, 0], [2, 1, 0])
    shear = np.zeros((3, 3))
    shear[lead] = np.linalg.cholesky(covariance[lead])
    return shear
