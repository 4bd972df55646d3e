"""The contact face: its nodes, pressures from nodal forces, and interpolation between nodes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tsis.mechanics._element import Floats, gauss_points, lobatto_values
from tsis.mechanics._mesh import refine

FACE_POINTS = 241  # evenly spaced radii of a press field
EDGE_FRACTION = 0.95  # of the radius; outside it the pressure may be singular and its sign is meaningless


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Face:
    """Element boundaries on the face, from the axis to the edge, and the order of the elements at the face."""

    lines: Floats
    order: int

    @property
    def radius_mm(self) -> Floats:
        """Radii of the nodes, ascending, shape (n,)."""
        return refine(self.lines, self.order)

    def interpolation(self, radius_mm: Floats) -> Floats:
        """Matrix from nodal values to values at ``radius_mm``, shape (len(radius_mm), n)."""
        cell = np.clip(np.searchsorted(self.lines, radius_mm, side="right") - 1, 0, len(self.lines) - 2)
        left, size = self.lines[cell], np.diff(self.lines)[cell]
        values = lobatto_values(self.order, 2 * (radius_mm - left) / size - 1)
        matrix = np.zeros((len(radius_mm), (len(self.lines) - 1) * self.order + 1))
        columns = cell[:, None] * self.order + np.arange(self.order + 1)
        np.put_along_axis(matrix, columns, values, axis=1)
        return matrix

    def mass(self) -> Floats:
        """Consistent mass of the face in mm^2: nodal forces (mN) = mass @ nodal pressures (kPa)."""
        x, w = gauss_points(self.order + 2)
        half = np.diff(self.lines) / 2
        radius = (self.lines[:-1, None] + half[:, None] * (x + 1)).ravel()
        weight = 2 * np.pi * radius * (half[:, None] * w).ravel()
        shape = self.interpolation(radius)
        return shape.T @ (weight[:, None] * shape)

    def averages(self, radius_mm: Floats) -> Floats:
        """Matrix from nodal values to means around ``radius_mm``, weighted by area and by distance to the neighbours.

        Means preserve the integral over the face: pressures sum up to the force, although they are singular at the
        edge. ``radius_mm`` ascends from 0 to the edge.
        """
        inside, area = ring_points(np.union1d(radius_mm, self.lines), points=self.order + 2)
        return means(radius_mm, inside, area, self.interpolation(inside))


def ring_points(ends: Floats, *, points: int = 6) -> tuple[Floats, Floats]:
    """Gauss points between the radii ``ends`` and the area of each in mm^2."""
    x, w = gauss_points(points)
    half = np.diff(ends)[:, None] / 2
    inside = (ends[:-1, None] + half * (x + 1)).ravel()
    return inside, 2 * np.pi * inside * (half * w).ravel()


def hats(radius_mm: Floats, at: Floats) -> Floats:
    """Hat functions at ``at``: 1 at one of ``radius_mm``, 0 at the others, linear between, shape (len(at), n)."""
    right = np.clip(np.searchsorted(radius_mm, at), 1, len(radius_mm) - 1)
    fraction = (at - radius_mm[right - 1]) / (radius_mm[right] - radius_mm[right - 1])
    values = np.zeros((len(at), len(radius_mm)))
    rows = np.arange(len(at))
    values[rows, right], values[rows, right - 1] = fraction, 1 - fraction
    return values


def means(radius_mm: Floats, inside: Floats, area: Floats, values: Floats) -> Floats:
    """Means around ``radius_mm`` of ``values`` (points, k) at the integration points ``inside``.

    The means cover the whole face; the values are zero where no integration point lies.
    """
    weighted = area[:, None] * hats(radius_mm, inside)
    return np.asarray(weighted.T @ values / hat_areas(radius_mm)[:, None])


def hat_areas(radius_mm: Floats) -> Floats:
    """Integrals over the face of the functions of `hats`, mm^2, shape (n,)."""
    inside, area = ring_points(radius_mm, points=2)
    return np.asarray(area @ hats(radius_mm, inside))
