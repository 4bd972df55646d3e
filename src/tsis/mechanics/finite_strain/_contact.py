"""Frictionless unilateral contact between the surface of one body and the obstacle that it slides on.

The pressure is a stiff spring of the overlap per reference area of the sliding surface. On each element edge a
polynomial interpolates the gap between a few points. The spring's energy is the exact integral over the part where
that polynomial is negative, so the edge of the contact moves smoothly through an element.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import legendre

from tsis.mechanics._element import Floats, Integers, lagrange, lobatto_points

if TYPE_CHECKING:
    from tsis.mechanics.finite_strain._surfaces import Obstacle


EDGE_ROUNDS = 8
EXTRA = 4  # points on an edge beyond the element's order
SAMPLES = 13  # on an edge, to bracket changes of the pressure's sign


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Linearised:
    """A contact's part of a Newton step."""

    forces: Floats  # forces on the coordinates (r, z) of its nodes in mN, shape (m,)
    matrix: Floats  # tangent in mN/mm, shape (m, m)
    gap_mm: Floats  # gaps at its points (k,)
    slope: Floats  # their first derivatives (k, m)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ContactSegment:
    """One closed part of an element edge."""

    edge: int  # index of the edge
    low: float  # start of the closed part, coordinate on the edge in [-1, 1]
    high: float  # its end
    pressure_kpa: Floats  # force per reference area at the edge's points ``gauss``, shape (count,)
    axial: Floats  # fraction of it along the axis at the same points, positive into the obstacle's body


class SlidingContact:
    """A surface of element edges that may touch an obstacle.

    ``surface`` has its nodes in order, shape (edges * order + 1,); ``reference`` has the positions of all nodes in mm.
    The order of the elements is at least 3. The pressure over the overlap is ``stiffness``, kPa/mm; ``steering`` is the
    same for the open or closed decision in Newton's method: much smaller, of the bodies' own stiffness.
    """

    def __init__(
        self, reference: Floats, surface: Integers, order: int, obstacle: Obstacle, stiffness: float, steering: float
    ) -> None:
        self.surface, self.order, self.obstacle, self.stiffness = surface, order, obstacle, stiffness
        self.nodes = np.concatenate([surface, obstacle.nodes])
        self.steering = steering
        self._reference = reference[surface]
        self._edges = (len(surface) - 1) // order
        self._lobatto = lobatto_points(order)
        self.count = order + EXTRA
        self.gauss = np.asarray(legendre.leggauss(self.count)[0], dtype=float)
        self._samples = np.linspace(-1.0, 1.0, SAMPLES)
        self._sampled, _ = lagrange(self.gauss, self._samples)
        # Coefficients of the polynomials through the points: ascending powers, one column a point.
        self._powers = np.linalg.inv(np.vander(self.gauss, increasing=True))
        edges = np.arange(self._edges)
        self._shapes = self.shapes(np.repeat(edges, self.count), np.tile(self.gauss, self._edges))

    def shapes(self, element: Integers, position: Floats) -> Floats:
        """Matrix from values at the surface's nodes to values at points on its edges, shape (k, nodes)."""
        values, _ = lagrange(self._lobatto, position)
        matrix = np.zeros((len(position), len(self.surface)))
        np.put_along_axis(matrix, element[:, None] * self.order + np.arange(self.order + 1), values, axis=1)
        return matrix

    def area(self, element: Integers, position: Floats, positions: Floats | None = None) -> Floats:
        """Area of the ring per unit of the edge's coordinate in mm^2: reference area, or area at ``positions``."""
        surface = self._reference if positions is None else positions[self.surface]
        values, slopes = lagrange(self._lobatto, position)
        local = surface[element[:, None] * self.order + np.arange(self.order + 1)]
        radius = (values * local[..., 0]).sum(axis=1)
        tangent = (slopes[..., None] * local).sum(axis=1)
        return np.asarray(2 * np.pi * radius * np.linalg.norm(tangent, axis=1))

    def between(self, position: Floats) -> Floats:
        """Matrix from values at an edge's points ``gauss`` to values at ``position``, shape (k, count)."""
        values, _ = lagrange(self.gauss, position)
        return values

    def energy(self, positions: Floats) -> float:
        """Energy of the springs in mN mm."""
        gaps = self._gaps(positions).reshape(self._edges, -1)
        element, position, area = self._closed_points(gaps, self.count)
        values, _ = lagrange(self.gauss, position)
        return float(self.stiffness / 2 * (area * (values * gaps[element]).sum(axis=1) ** 2).sum())

    def pressure(self, positions: Floats) -> Floats:
        """Pressure in kPa from the overlaps at its points, shape (k,); negative where the contact is open."""
        return -self.stiffness * self._gaps(positions)

    def derivatives(self, positions: Floats, pressure: Floats) -> Linearised:
        """Forces and tangent by the coordinates of ``nodes``, for a ``pressure`` (k,) that is an unknown of its own.

        The pressure of the last linear solution decides where the contact is closed and how it bends the tangent. The
        overlap is meaningless after a large step; at the solution both agree.
        """
        own, here = positions[self.obstacle.nodes], self._shapes @ positions[self.surface]
        gap = self.obstacle.gap(own, here)
        expected = pressure - self.steering * (gap + pressure / self.stiffness)
        element, position, area = self._closed_points(-expected.reshape(self._edges, -1), self.count)
        values, _ = lagrange(self.gauss, position)
        matrix = np.zeros((self._edges, self.count, self.count))
        np.add.at(matrix, element, area[:, None, None] * values[:, :, None] * values[:, None])
        by_edge = pressure.reshape(self._edges, -1, 1)
        gaps = self.obstacle.differentiate(own, here, self._shapes, -(matrix @ by_edge).ravel())
        overlap_force = self.stiffness * (matrix @ gaps.gap_mm.reshape(self._edges, -1, 1)).ravel()
        slopes = gaps.slope.reshape(self._edges, self.count, -1)
        transported = self.stiffness * (matrix @ slopes).reshape(gaps.slope.shape)
        return Linearised(
            forces=gaps.slope.T @ overlap_force,
            matrix=gaps.slope.T @ transported + gaps.curvature,
            gap_mm=gaps.gap_mm,
            slope=gaps.slope,
        )

    def pressed(self, positions: Floats) -> list[ContactSegment]:
        """The closed parts of the surface, from its first node to its last."""
        own, here = positions[self.obstacle.nodes], self._shapes @ positions[self.surface]
        gaps = self.obstacle.gap(own, here).reshape(self._edges, -1)
        axial = self.obstacle.normals(own, here)[:, 1].reshape(self._edges, -1)
        return [
            ContactSegment(
                edge=int(edge),
                low=float(low),
                high=float(high),
                pressure_kpa=-self.stiffness * gaps[edge],
                axial=axial[edge],
            )
            for edge, low, high in zip(*self._closed_parts(gaps), strict=True)
        ]

    def points(self, element: Integers, position: Floats, positions: Floats) -> Floats:
        """Positions of points on the edges, mm, shape (k, 2)."""
        return np.asarray(self.shapes(element, position) @ positions[self.surface])

    def _gaps(self, positions: Floats) -> Floats:
        here = self._shapes @ positions[self.surface]
        return self.obstacle.gap(positions[self.obstacle.nodes], here)

    def _closed_points(self, gaps: Floats, count: int) -> tuple[Integers, Floats, Floats]:
        """Edge, coordinate and reference area of ``count`` Gauss points on every closed part."""
        part, low, high = self._closed_parts(gaps)
        gauss, weight = legendre.leggauss(count)
        half = (high - low) / 2
        position = ((low + half)[:, None] + half[:, None] * gauss).ravel()
        element = np.repeat(part, count)
        return element, position, (half[:, None] * weight).ravel() * self.area(element, position)

    def _closed_parts(self, gaps: Floats) -> tuple[Integers, Floats, Floats]:
        """Edge and ends of every interval where the polynomial through an edge's gaps is negative."""
        inside = gaps @ self._sampled.T < 0
        at, left = np.nonzero(inside[:, 1:] != inside[:, :-1])
        root = self._root(gaps[at], self._samples[left], self._samples[left + 1])
        begin, finish = np.nonzero(inside[:, 0])[0], np.nonzero(inside[:, -1])[0]
        opens = ~inside[at, left]  # the contact is closed after this root
        start_at, start = np.append(begin, at[opens]), np.append(np.full(len(begin), -1.0), root[opens])
        stop_at, stop = np.append(finish, at[~opens]), np.append(np.full(len(finish), 1.0), root[~opens])
        first, last = np.lexsort((start, start_at)), np.lexsort((stop, stop_at))
        return start_at[first], start[first], stop[last]

    def _root(self, gaps: Floats, low: Floats, high: Floats) -> Floats:
        """Roots of the polynomials between ``low`` and ``high``, by regula falsi (Illinois)."""
        if len(low) == 0:
            return low
        powers = gaps @ self._powers.T

        def value(x: Floats) -> Floats:
            return np.asarray((powers * x[:, None] ** np.arange(powers.shape[1])).sum(axis=1))

        at_low, at_high = value(low), value(high)
        middle = low
        for _ in range(EDGE_ROUNDS):
            middle = (low * at_high - high * at_low) / (at_high - at_low)
            at_middle = value(middle)
            same = (at_middle < 0) == (at_high < 0)
            at_low, low = np.where(same, at_low / 2, at_high), np.where(same, low, high)
            at_high, high = at_middle, middle
        return middle
