"""Frictionless unilateral contact of a body with a smooth obstacle.

The pressure is a stiff spring of the overlap per reference area of the sliding surface. On each element edge a
polynomial interpolates the gap between a few points. The spring's energy is the exact integral over the part where
that polynomial is negative, so the edge of the contact moves smoothly through an element.

The obstacle is a twice differentiable curve through the nodes of a face, because faces of finite elements have kinks
between elements, and a closest point jumps across a kink. The curve is the exact undeformed outline plus a cubic
spline: the least-squares fit to the elements' displacement over the face's area. So the curve is linear in the nodes'
positions, and the nodal forces of a smooth pressure are consistent.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
import scipy
from numpy.polynomial import legendre

from tsis.mechanics.mesh import Floats, Integers, lagrange, lobatto_points

if TYPE_CHECKING:
    from collections.abc import Callable


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


DEGREE = 3
OUTLINE_POINTS = 4001
CLOSEST_ROUNDS = 12
START_POINTS = 5  # between two nodes: candidates to start the search for the closest point


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ClosestPoints:
    """Closest points of a curve and the curve's derivatives there."""

    parameter: Floats  # parameter of each point, shape (k,): the arc length in the reference shape from the axis, mm
    gap_mm: Floats  # signed distance, positive outside the body, shape (k,)
    normal: Floats  # outward unit normal, shape (k, 2)
    slope: Floats  # first derivative of the position by the parameter, shape (k, 2)
    bend: Floats  # second derivative, shape (k, 2)


class SmoothFace:
    """The curve of a face from the axis outwards; the body lies at smaller z.

    ``parameter`` has the arc length of each node on the outline, ascending from 0 on the axis, mm, shape (n,).
    ``outline`` gives points (r, z) of the undeformed outline in mm at arc lengths, shape (k, 2).
    """

    def __init__(self, parameter: Floats, order: int, outline: Callable[[Floats], Floats]) -> None:
        self.parameter, steps = parameter, np.diff(parameter)
        self.end = float(self.parameter[-1])
        nodes = outline(parameter)
        self._nodes = nodes
        dense = np.linspace(0.0, self.end, OUTLINE_POINTS)
        both = np.concatenate([outline(dense)[:0:-1] * [-1.0, 1.0], outline(dense)])
        shape = scipy.interpolate.make_interp_spline(np.concatenate([-dense[:0:-1], dense]), both, k=DEGREE)
        self._shape = (shape, shape.derivative(1), shape.derivative(2))
        self._knots, self._controls = _projection(parameter, nodes[:, 0], order)
        self._splines = tuple(scipy.interpolate.BSpline(self._knots, controls, DEGREE) for controls in self._controls)
        self._derivatives = tuple(
            tuple(spline if nu == 0 else spline.derivative(nu) for spline in self._splines) for nu in (0, 1)
        )
        fine = np.arange(START_POINTS) / START_POINTS
        self._starts = np.append((self.parameter[:-1, None] + steps[:, None] * fine).ravel(), self.end)

        self._start_shape, self._start_weights = self._shape[0](self._starts), self.weights(self._starts)

    def weights(self, position: Floats, derivative: int = 0) -> Floats:
        """Matrices from nodal r and nodal z to the position (or its slope) at ``position``, shape (k, 2, nodes)."""
        return np.stack([spline(position) for spline in self._derivatives[derivative]], axis=1)

    def closest(self, positions: Floats, points: Floats) -> ClosestPoints:
        """Points of the curve closest to ``points`` (k, 2), the curve's nodes lying at ``positions``."""
        nodal = positions - self._nodes
        controls = np.stack([self._controls[i] @ nodal[:, i] for i in (0, 1)], axis=1)
        displaced = scipy.interpolate.BSpline(self._knots, controls, DEGREE)
        shifts = (displaced, displaced.derivative(1), displaced.derivative(2))

        def curve(position: Floats, nu: int) -> Floats:
            return np.asarray(self._shape[nu](position) + shifts[nu](position))

        starts = self._start_shape + np.einsum("skn,nk->sk", self._start_weights, nodal)
        distance = ((points[:, None] - starts) ** 2).sum(axis=2)
        arc = self._starts[distance.argmin(axis=1)]
        extent = self.end / len(self._starts)
        for _ in range(CLOSEST_ROUNDS):
            away, slope, bend = points - curve(arc, 0), curve(arc, 1), curve(arc, 2)
            residual = (away * slope).sum(axis=1)
            steep = (slope**2).sum(axis=1)
            curvature = np.maximum(steep - (away * bend).sum(axis=1), 0.1 * steep)
            step = np.clip(residual / curvature, -extent, extent)
            # A step may cross the axis, where the curve continues mirrored, but not the outer end.
            there = np.minimum(arc + step, self.end)
            done = np.abs(there - arc).max(initial=0.0) < 1e-13 * self.end
            arc = there
            if done:
                break
        slope = curve(arc, 1)
        normal = np.stack([-slope[:, 1], slope[:, 0]], axis=1) / np.linalg.norm(slope, axis=1)[:, None]
        gap = ((points - curve(arc, 0)) * normal).sum(axis=1)
        return ClosestPoints(parameter=arc, gap_mm=gap, normal=normal, slope=slope, bend=curve(arc, 2))


def _projection(parameter: Floats, radius: Floats, order: int) -> tuple[Floats, Floats]:
    """Knots of the spline, and matrices (2, controls, nodes) from nodal (r, z) to its controls.

    Least squares over the area of the face; r is odd across the axis and z is even.
    """
    ends = parameter[::order]
    spans = max(1, order // 2)
    inner = (ends[:-1, None] + np.diff(ends)[:, None] * np.arange(spans) / spans).ravel()
    half = np.append(inner, ends[-1])
    whole = np.concatenate([-half[:0:-1], half])
    knots = np.concatenate([[whole[0]] * DEGREE, whole, [whole[-1]] * DEGREE])
    count = len(knots) - DEGREE - 1
    gauss, weight = legendre.leggauss(order + 2)
    size = np.diff(half) / 2
    position = ((half[:-1] + size)[:, None] + size[:, None] * gauss).ravel()
    cell = np.clip(np.searchsorted(ends, position, side="right") - 1, 0, len(ends) - 2)
    local, _ = lagrange(lobatto_points(order), 2 * (position - ends[cell]) / np.diff(ends)[cell] - 1)
    trace = np.zeros((len(position), len(parameter)))
    np.put_along_axis(trace, cell[:, None] * order + np.arange(order + 1), local, axis=1)
    area = (size[:, None] * weight).ravel() * (trace @ radius)
    basis = scipy.interpolate.BSpline(knots, np.eye(count), DEGREE)(position)
    controls = []
    for sign in (-1.0, 1.0):
        fold = np.eye(count)[:, (count // 2 if sign > 0 else (count + 1) // 2) :]
        fold = fold + sign * fold[::-1] * (np.arange(count)[:, None] != np.arange(count)[::-1][:, None])
        folded = basis @ fold
        controls.append(fold @ np.linalg.solve(folded.T @ (area[:, None] * folded), folded.T @ (area[:, None] * trace)))
    return knots, np.stack(controls)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Gaps:
    """Signed gaps of k points and their derivatives by m coordinates."""

    gap_mm: Floats  # shape (k,)
    slope: Floats  # first derivatives, shape (k, m)
    curvature: Floats  # sum over the points of a weight times the second derivatives, shape (m, m)


class Obstacle(Protocol):
    """A surface that other bodies slide on."""

    nodes: Integers

    def gap(self, positions: Floats, points: Floats) -> Floats:
        """Signed distance of ``points`` (k, 2) in mm, positive outside."""

    def normals(self, positions: Floats, points: Floats) -> Floats:
        """Outward unit normals at the feet of ``points``, shape (k, 2)."""

    def differentiate(self, positions: Floats, points: Floats, shapes: Floats, force: Floats) -> Gaps:
        """Gaps with derivatives by (slave coordinates, own coordinates); ``shapes`` (k, slaves), ``force`` (k,)."""


class SoftFace:
    """The face of a deformable body, smoothed."""

    def __init__(self, face: SmoothFace, nodes: Integers) -> None:
        self.face, self.nodes = face, nodes

    def gap(self, positions: Floats, points: Floats) -> Floats:
        """See `Obstacle`."""
        return self.face.closest(positions, points).gap_mm

    def normals(self, positions: Floats, points: Floats) -> Floats:
        """See `Obstacle`."""
        return self.face.closest(positions, points).normal

    def differentiate(self, positions: Floats, points: Floats, shapes: Floats, force: Floats) -> Gaps:
        """Exact first and second derivatives of the closest-point gap.

        With the curve ``y(t)``, its normal n, ``m = |y'|^2``, ``k = n y''`` and ``D = m - g k``: the gap's first
        variation is ``n (dx - dy)``, its second ``-(k/m a a + a b + b a + g b b)/D`` with ``a = y' (dx - dy)`` and
        ``b = n dy'``.
        """
        foot = self.face.closest(positions, points)
        weights, slopes = self.face.weights(foot.parameter), self.face.weights(foot.parameter, 1)
        count, slaves, own = len(points), shapes.shape[1], len(self.nodes)
        relative = np.zeros((count, slaves + own, 2, 2))  # of the point to its foot: direction, coordinate
        rotation = np.zeros((count, slaves + own, 2, 2))
        for i in (0, 1):
            relative[:, :slaves, i, i] = shapes
            relative[:, slaves:, i, i] = -weights[:, i]
            rotation[:, slaves:, i, i] = slopes[:, i]
        flat = (count, (slaves + own) * 2)
        slope = np.einsum("ksdi,kd->ksi", relative, foot.normal).reshape(flat)
        a = np.einsum("ksdi,kd->ksi", relative, foot.slope).reshape(flat)
        b = np.einsum("ksdi,kd->ksi", rotation, foot.normal).reshape(flat)
        metric = (foot.slope**2).sum(axis=1)
        bend = (foot.normal * foot.bend).sum(axis=1)
        weight = force / (metric - foot.gap_mm * bend)
        mixed = a.T @ (weight[:, None] * b)
        curvature = -(
            a.T @ ((weight * bend / metric)[:, None] * a)
            + mixed
            + mixed.T
            + b.T @ ((weight * foot.gap_mm)[:, None] * b)
        )
        return Gaps(gap_mm=foot.gap_mm, slope=slope, curvature=curvature)


class Plate:
    """A rigid frictionless plane that faces a body from larger z and moves towards smaller z.

    The displacement along z of ``node``, which has no elements, is the travel from the initial ``height_mm``.
    """

    def __init__(self, node: int, height_mm: float) -> None:
        self.nodes, self._height = np.array([node]), height_mm

    def gap(self, positions: Floats, points: Floats) -> Floats:
        """See `Obstacle`."""
        return np.asarray(self._height - positions[0, 1] - points[:, 1])

    def normals(self, positions: Floats, points: Floats) -> Floats:
        """See `Obstacle`."""
        return np.tile([0.0, -1.0], (len(points), 1))

    def differentiate(self, positions: Floats, points: Floats, shapes: Floats, force: Floats) -> Gaps:
        """The gap is linear in the coordinates."""
        slope = np.zeros((len(points), shapes.shape[1] + 1, 2))
        slope[:, :-1, 1], slope[:, -1, 1] = -shapes, -1.0
        flat = slope.reshape(len(points), -1)
        size = flat.shape[1]
        return Gaps(gap_mm=self.gap(positions, points), slope=flat, curvature=np.zeros((size, size)))
