"""Cells of a sheared box, and how much of each lies inside the support of a density."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Support = Callable[[NDArray[np.float64]], NDArray[np.bool_]]


@cache
def _lattice(per_axis: int, *, ends: bool) -> NDArray[np.float64]:
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
    """Cells of a sheared box that lie at least in part inside the support.

    Attributes
    ----------
    centre
        Their centres, shape (n, 3).
    edges
        One cell's edge vectors as rows, shape (3, 3).
    points
        Centroids of the parts inside, shape (n, 3).
    share
        Share of each cell that lies inside, shape (n,), in (0, 1].
    """

    centre: NDArray[np.float64]
    edges: NDArray[np.float64]
    points: NDArray[np.float64]
    share: NDArray[np.float64]


def cells_of(origin: NDArray[np.float64], axes: NDArray[np.float64], per_axis: int, support: Support) -> GridCells:
    """Cells of the box spanned by the rows of ``axes``, without those outside the support."""
    centre = origin + (_lattice(per_axis, ends=False) + 0.5) @ axes
    edges = axes / per_axis
    if support(origin + (INNER_AND_ENDS + 0.5) @ axes).all():  # the region bulges little, so that all cells lie inside
        return GridCells(centre=centre, edges=edges, points=centre, share=np.ones(len(centre)))
    corners = _corners_inside(origin, axes, per_axis, support)
    centre, corners = centre[corners > 0], corners[corners > 0]
    points, share = centre.copy(), np.ones(len(centre))
    cut = corners < CORNERS
    inner = centre[cut][:, None] + INNER @ edges
    inside = support(inner.reshape(-1, 3)).reshape(-1, len(INNER)).astype(float)
    count = inside.sum(axis=1)
    share[cut] = count / len(INNER)
    points[cut] += (inside / np.maximum(count, 1.0)[:, None]) @ INNER @ edges
    some = share > 0
    return GridCells(centre=centre[some], edges=edges, points=points[some], share=share[some])


def _corners_inside(
    origin: NDArray[np.float64], axes: NDArray[np.float64], per_axis: int, support: Support
) -> NDArray[np.int64]:
    """How many corners of each cell lie inside the support, shape (cells,); neighbours share theirs."""
    vertices = support(origin + (_lattice(per_axis + 1, ends=True) + 0.5) @ axes)
    cube = vertices.reshape(3 * (per_axis + 1,)).astype(np.int64)
    for axis in range(3):
        low, high = (np.take(cube, range(start, start + per_axis), axis=axis) for start in (0, 1))
        cube = low + high
    return cube.ravel()
