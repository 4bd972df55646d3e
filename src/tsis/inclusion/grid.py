"""Posterior on a grid that finds its own place: tempered, sheared along the posterior, refined.

A first grid covers the prior's box. The likelihood is tempered until enough cells carry weight; the next grid is laid
along the correlations of that tempered posterior, where it has weight, and so on until the temperature is one. Bent and
one-sided posteriors at the edge of the prior survive this, as nothing is assumed normal.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq
from scipy.stats import qmc

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

ENOUGH_CELLS = 80.0  # effective number of cells that a refinement step leaves
NEGLIGIBLE = 1e-7  # weight, relative to the best cell, that the next grid may leave out
STEPS = 10


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Grid:
    """Cells of a sheared box: ``points`` (n, 3), ``cell`` the three edge vectors (3, 3), ``weight`` (n,)."""

    points: NDArray[np.float64]
    cell: NDArray[np.float64]
    weight: NDArray[np.float64]

    def mean(self) -> NDArray[np.float64]:
        """Weighted mean of the points, shape (3,)."""
        return np.asarray(self.weight @ self.points)

    def samples(self, count: int) -> NDArray[np.float64]:
        """``count`` equally weighted samples by a Sobol sequence, shape (count, 3): the same every time."""
        unit = qmc.Sobol(4, scramble=False).random_base2(int(np.ceil(np.log2(count))))[:count] + 0.5 / count
        chosen = np.searchsorted(np.cumsum(self.weight), unit[:, 0] % 1.0)
        spread = (unit[:, 1:] % 1.0 - 0.5) @ self.cell
        return np.asarray(self.points[np.minimum(chosen, len(self.points) - 1)] + spread)


def refine(
    log_density: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    *,
    per_axis: int = 16,
) -> Grid:
    """Refine a grid on the box [low, high] until it resolves the density.

    Parameters
    ----------
    log_density
        Log density, up to a constant, of points (n, 3), minus infinity where it is zero; called once a refinement.
    low, high
        A box that holds all of the density, shape (3,) each.
    per_axis
        Cells along each axis.
    """
    origin, axes = low, np.diag(high - low)
    resolved = False
    for _ in range(STEPS):
        points, cell = _cells(origin, axes, per_axis)
        log_weight = log_density(points)
        log_weight -= log_weight.max()
        power = _temper(log_weight)
        if resolved and power == 1.0:
            break
        # One more grid at temperature one: the last that was tempered is too wide for the density itself.
        resolved = power == 1.0
        origin, axes = _sheared_box(points, log_weight * power, cell, low, high)
    weight = np.exp(log_weight)
    return Grid(points=points, cell=cell, weight=weight / weight.sum())


def _cells(
    origin: NDArray[np.float64], axes: NDArray[np.float64], per_axis: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centres of the cells of the box spanned by the rows of ``axes``, and one cell's edge vectors."""
    steps = (np.arange(per_axis) + 0.5) / per_axis
    unit = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
    return origin + unit @ axes, axes / per_axis


def _effective(log_weight: NDArray[np.float64]) -> float:
    weight = np.exp(log_weight)
    return float(weight.sum() ** 2 / (weight**2).sum())


def _temper(log_weight: NDArray[np.float64]) -> float:
    """Largest power of the density, at most one, at which enough cells carry weight."""
    if _effective(log_weight) >= ENOUGH_CELLS:
        return 1.0
    return float(
        np.exp(brentq(lambda power: _effective(log_weight * np.exp(power)) - ENOUGH_CELLS, -30.0, 0.0, xtol=1e-2))
    )


def _sheared_box(
    points: NDArray[np.float64],
    log_weight: NDArray[np.float64],
    cell: NDArray[np.float64],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Box that holds all cells of weight, sheared along the weighted points.

    The last coordinate leads: its range is never tilted, so that a flat posterior keeps the prior's ends exactly.
    """
    lead = [2, 1, 0]
    weight = np.exp(log_weight)
    weight /= weight.sum()
    middle = weight @ points
    centred = points - middle
    covariance = (weight[:, None] * centred).T @ centred + cell.T @ cell / 12
    shear = np.zeros((3, 3))
    shear[np.ix_(lead, lead)] = np.linalg.cholesky(covariance[np.ix_(lead, lead)])
    inverse = np.linalg.inv(shear)
    along = centred[weight > NEGLIGIBLE * weight.max()] @ inverse.T
    margin = np.abs(cell @ inverse.T).sum(axis=0) / 2
    first, last = along.min(axis=0) - margin, along.max(axis=0) + margin
    first[2] = max(first[2], (low[2] - middle[2]) * inverse[2, 2])
    last[2] = min(last[2], (high[2] - middle[2]) * inverse[2, 2])
    return middle + shear @ first, (shear * (last - first)).T
