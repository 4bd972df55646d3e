"""The contact face: its nodes, the pressure that nodal forces mean, and values between nodes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import legendre

from tsis.mechanics.element import lagrange, lobatto_points
from tsis.mechanics.mesh import refine

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Face:
    """Element boundaries on the face, from the axis to the edge, and the order of the elements that end there."""

    lines: NDArray[np.float64]
    order: int

    @property
    def radius_mm(self) -> NDArray[np.float64]:
        """Radii of the nodes, ascending, shape (n,)."""
        return refine(self.lines, self.order)

    def interpolation(self, radius_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Matrix from nodal values to values at ``radius_mm``, shape (len(radius_mm), n)."""
        cell = np.clip(np.searchsorted(self.lines, radius_mm, side="right") - 1, 0, len(self.lines) - 2)
        left, size = self.lines[cell], np.diff(self.lines)[cell]
        values, _ = lagrange(lobatto_points(self.order), 2 * (radius_mm - left) / size - 1)
        matrix = np.zeros((len(radius_mm), len(self.radius_mm)))
        columns = cell[:, None] * self.order + np.arange(self.order + 1)
        np.put_along_axis(matrix, columns, values, axis=1)
        return matrix

    def mass(self) -> NDArray[np.float64]:
        """Consistent mass of the face in mm^2: nodal forces (mN) = mass @ nodal pressures (kPa)."""
        x, w = legendre.leggauss(self.order + 2)
        half = np.diff(self.lines) / 2
        radius = (self.lines[:-1, None] + half[:, None] * (x + 1)).ravel()
        weight = 2 * np.pi * radius * (half[:, None] * w).ravel()
        shape = self.interpolation(radius)
        return shape.T @ (weight[:, None] * shape)

    def averages(self, radius_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Matrix from nodal values to means around ``radius_mm``, weighted by area and by distance to the neighbours.

        Unlike values at a point they keep the integral over the face, so that pressures sum up to the force although
        they are singular at the edge; ``radius_mm`` ascends from 0 to the edge.
        """
        ends = np.union1d(radius_mm, self.lines)
        x, w = legendre.leggauss(self.order + 2)
        half = np.diff(ends) / 2
        inside = (ends[:-1, None] + half[:, None] * (x + 1)).ravel()
        right = np.clip(np.searchsorted(radius_mm, inside), 1, len(radius_mm) - 1)
        share = (inside - radius_mm[right - 1]) / (radius_mm[right] - radius_mm[right - 1])
        hats = np.zeros((len(radius_mm), len(inside)))
        columns = np.arange(len(inside))
        hats[right, columns], hats[right - 1, columns] = share, 1 - share
        hats *= inside * (half[:, None] * w).ravel()
        return np.asarray(hats @ self.interpolation(inside) / hats.sum(axis=1, keepdims=True))
