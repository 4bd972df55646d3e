"""Unilateral contact of two bodies that are condensed onto the face: by nodes, and over a disc with any edge.

By nodes, contact is a small linear complementarity problem: at each node the gap is closed with a force >= 0, or open
without force. With a positive definite compliance it has one solution.

A disc's edge need not lie on a node. Inside the disc of radius a the pressure is ``sqrt(1 - s**2)`` times a polynomial
in ``s**2``, s = r / a, as it is under every smooth body (Hertz is the constant). The mean gap, weighted by each of
these pressures and by ``1 / sqrt(1 - s**2)``, is zero: the energy is stationary. The last condition is its stationarity
by a: the pressure vanishes at the edge.

A half-space's response to these pressures has a closed form (Copson 1947), and no mesh resolves the kink at an edge
inside an element. So the compliance has two parts: the exact half-space, and the smooth change of it by layers, walls,
inclusion and probe, the difference of two compliances from ONE mesh.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.errors import InputError, MechanicsError
from tsis.mechanics.mesh import EDGE_FRACTION, Floats, gauss_points, hats, means, ring_points
from tsis.model.press import MN_PER_N
from tsis.model.require import require_array, require_number

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike

    from tsis.mechanics.mesh import Booleans, Face, Floats
    from tsis.model.probe import Probe


TERMS = 10  # polynomials in s**2
POINTS = 28  # Gauss points over the disc; they integrate all terms to rounding
FEWEST = 13  # Gauss points between two lines of the face
SMALLEST = np.log(1e-3)  # smallest contact radius over the face's
FORCE_POWER = 2.7  # power of the radius in the force; 3 under a rigid dome on a half-space
STEPS = 60
FORCE_ROUNDING = 1e-11  # of the force
TINY = 1e-300


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DiscContact:
    """A contact over a disc."""

    radius_mm: float  # radius of the disc; the pressure vanishes there
    terms: Floats  # factors of the pressure's terms, kPa, shape (terms,)
    force: Floats  # forces on the face's nodes, mN, shape (n,)
    approach_mm: float  # travel since first touch

    def pressure_kpa(self, radius_mm: Floats) -> Floats:
        """Pressure at ``radius_mm``, zero outside the contact."""
        angle = np.arcsin(np.minimum(radius_mm / self.radius_mm, 1.0))
        return regular_terms(angle) @ self.terms


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Elastic:
    """Two bodies in contact."""

    half_space: float  # compliance ``(1 - nu**2) / E`` of the exact half-space, 1/kPa
    smooth: Floats  # compliance of both bodies less that of the half-space on the face's nodes, mm/mN, shape (n, n)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Loads:
    """Loads by each term of the pressure on a disc; the last column is the term that is infinite at its edge."""

    nodal: Floats  # nodal forces from 1 kPa, shape (n, terms + 1)
    total: Floats  # total force from 1 kPa, shape (terms + 1,)
    gap: Floats  # undeformed gap weighted by the term, mm mN/kPa, shape (terms + 1,)


def loads(face: Face, gap_mm: Callable[[Floats], Floats], radius_mm: float) -> Loads:
    """Integrate the terms over a disc, in the angle arcsin(r / a), which makes the edge smooth."""
    cells = int(np.count_nonzero(face.lines < radius_mm))
    angle, weight = disc_points(face.lines, radius_mm, max(FEWEST, POINTS // cells))
    fraction = np.sin(angle)
    area = 2 * np.pi * radius_mm**2 * fraction * np.cos(angle) * weight
    values = np.column_stack([regular_terms(angle), 1 / np.cos(angle)])
    weighted = area[:, None] * values
    radius = radius_mm * fraction
    return Loads(
        nodal=face.interpolation(radius).T @ weighted, total=weighted.sum(axis=0), gap=gap_mm(radius) @ weighted
    )


def disc_points(lines: Floats, radius_mm: float, points: int) -> tuple[Floats, Floats]:
    """Gauss points and weights in the angle arcsin(r / a), between the ``lines`` on the disc."""
    ends = np.arcsin(np.append(lines[lines < radius_mm], radius_mm) / radius_mm)
    x, w = gauss_points(points)
    half = np.diff(ends)[:, None] / 2
    return (ends[:-1, None] + half * (x + 1)).ravel(), (half * w).ravel()


def regular_terms(angle: Floats) -> Floats:
    """The terms that are finite at the disc's edge, in the angle arcsin(r / a), shape (len(angle), terms)."""
    return np.asarray(np.cos(angle)[:, None] * _polynomials(angle))


def on_disc(contact: Elastic, on: Loads, radius_mm: float) -> DiscContact:
    """The contact of radius ``radius_mm`` at any force."""
    response = on.nodal.T @ contact.smooth @ on.nodal[:, :-1]
    response += contact.half_space * radius_mm**3 * half_space_response()
    solution = np.asarray(np.linalg.solve(np.column_stack([response, -on.total]), -on.gap), dtype=float)
    return DiscContact(
        radius_mm=radius_mm,
        terms=solution[:-1],
        force=on.nodal[:, :-1] @ solution[:-1],
        approach_mm=float(solution[-1]),
    )


def under_force(
    contact: Elastic, face: Face, gap_mm: Callable[[Floats], Floats], force_mn: float, *, largest: DiscContact
) -> DiscContact:
    """The contact under ``force_mn``, less than the force of ``largest``, the contact of the whole face."""
    # Secant method in the logarithms, where Hertz's law is a line; `largest` is the first point.
    log_force = np.log(force_mn)
    before, excess_before = 0.0, float(np.log(largest.force.sum()) - log_force)
    here = -excess_before / FORCE_POWER
    for _ in range(STEPS):
        radius = float(np.exp(np.clip(here, SMALLEST, 0.0))) * largest.radius_mm
        result = on_disc(contact, loads(face, gap_mm, radius), radius)
        excess = float(np.log(max(result.force.sum(), TINY)) - log_force)
        if abs(excess) < FORCE_ROUNDING:
            return result
        if excess == excess_before:
            break
        before, here, excess_before = here, here - excess * (here - before) / (excess - excess_before), excess
    raise MechanicsError(
        f"force_n must be large enough for the mesh to resolve the contact; {force_mn / MN_PER_N:g} N touch less than "
        f"{radius:.2g} mm; choose a larger force"
    )


@cache
def half_space_response() -> Floats:
    """Work of each term's pressure (rows) on each regular term's displacement, for a = 1 and (1 - nu**2) / E = 1.

    It is 8 times the integral of the product of their Abel transforms from 0 to a; shape (terms + 1, terms).
    """
    t, weight = _unit_points(2 * TERMS + 2)
    regular = _abel_transforms(t)
    transforms = np.column_stack([regular, np.full_like(t, np.pi / 2)])
    return np.asarray(8 * transforms.T @ (weight[:, None] * regular))


def displaced_outside(disc: DiscContact, radius_mm: Floats) -> Floats:
    """Displacement of a half-space of (1 - nu**2) / E = 1 / kPa outside the contact, at ``radius_mm``, mm."""
    t, weight = _unit_points(4 * TERMS)
    angle, angle_weight = np.pi * t / 2, np.pi * weight / 2
    fraction = np.sin(angle)
    transform = disc.radius_mm * (_abel_transforms(fraction) @ disc.terms)
    distance = np.sqrt((radius_mm[:, None] / disc.radius_mm) ** 2 - fraction**2)
    return np.asarray(4 / np.pi * (1 / distance) @ (angle_weight * np.cos(angle) * transform))


def _abel_transforms(t: Floats) -> Floats:
    """Integral of r p(r) / sqrt(r**2 - t**2) from t to a for each term p, with a = 1; shape (len(t), terms)."""
    x, weight = _unit_points(2 * TERMS + 2)
    angle, weight = np.pi * x / 2, np.pi * weight / 2
    there = np.arcsin(np.sqrt(t[:, None] ** 2 + (1 - t[:, None] ** 2) * np.sin(angle) ** 2))
    return np.asarray((1 - t[:, None] ** 2) * np.einsum("tak,a->tk", _polynomials(there), weight * np.cos(angle) ** 2))


def _unit_points(count: int) -> tuple[Floats, Floats]:
    """Gauss points and weights on [0, 1]."""
    x, w = gauss_points(count)
    return (x + 1) / 2, w / 2


def _polynomials(angle: Floats) -> Floats:
    """Chebyshev polynomials of 1 - 2 s**2 with s = sin(``angle``), along a new last axis."""
    return np.asarray(np.cos(2 * angle[..., None] * np.arange(TERMS)))


ROUNDING = 1e-12  # forces and gaps this small, relative to the largest, have no sign
MOST_STALLED_EXCHANGES = 3  # exchanges of all wrong nodes without progress before single ones are exchanged


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ContactDiagnostics:
    """Diagnostics of `unilateral_contact`."""

    closed: Booleans  # whether each node touches, shape (n,)
    gap_mm: Floats  # remaining gap at each node, shape (n,), mm; zero where closed
    iterations: int  # number of linear solves


def unilateral_contact(
    compliance: ArrayLike, gap_mm: ArrayLike, approach_mm: float
) -> tuple[Floats, ContactDiagnostics]:
    """Nodal forces in mN, shape (n,), when two bodies approach each other and may touch but not pull.

    Solves ``f >= 0`` and ``gap = C f + gap_mm - approach_mm >= 0`` with ``f * gap = 0`` node by node. The compliance of
    both bodies, mm/mN, (n, n), is symmetric positive definite; ``gap_mm``, (n,), is the undeformed gap at first touch,
    ``approach_mm`` the travel since then, in [-1e6, 1e6]. Block principal pivoting (Judice and Pires 1994) solves for
    the closed nodes and exchanges those with a negative force or gap. When this makes no progress, it exchanges only
    the last of them, which always terminates. Raises `InputError` when the shapes do not match, `MechanicsError`
    without solution.

    Examples
    --------
    >>> force, contact = unilateral_contact([[2.0, 1.0], [1.0, 2.0]], [0.0, 3.0], 1.0)
    >>> force.tolist(), contact.gap_mm.tolist()
    ([0.5, 0.0], [0.0, 2.5])
    """
    matrix = require_array("compliance", compliance, ndim=2)
    gap = require_array("gap_mm", gap_mm, ndim=1)
    approach = require_number("approach_mm", approach_mm, -1e6, 1e6, hint="millimetres")
    if matrix.shape != (gap.size, gap.size):
        raise InputError(f"compliance must have shape ({gap.size}, {gap.size}), as gap_mm has; got {matrix.shape}")
    overlap = approach - gap
    closed, fewest, attempts = overlap > 0, gap.size + 1, MOST_STALLED_EXCHANGES
    for iteration in range(1, 100 + 10 * gap.size):
        force = np.zeros(gap.size)
        force[closed] = np.linalg.solve(matrix[np.ix_(closed, closed)], overlap[closed])
        rest = np.where(closed, 0.0, matrix @ force - overlap)
        wrong = (force < -ROUNDING * np.abs(force).max()) | (rest < -ROUNDING * np.abs(overlap).max())
        count = int(np.count_nonzero(wrong))
        if count == 0:
            return np.maximum(force, 0.0), ContactDiagnostics(closed=closed, gap_mm=rest, iterations=iteration)
        if count < fewest:
            fewest, attempts = count, MOST_STALLED_EXCHANGES
        else:
            attempts -= 1
        if attempts < 0:
            wrong[: np.flatnonzero(wrong)[-1]] = False
        closed = closed ^ wrong
    raise MechanicsError("compliance must be symmetric positive definite for a contact to exist; the search failed")


PULL = 1e-6  # pressures this far below zero, relative to the mean, are rounding


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PartialContact:
    """A contact over the face or a part of it.

    Attributes
    ----------
    force
        Forces on the face's nodes, mN, shape (n,).
    pressure_kpa
        Mean pressures around the radii of `FaceContact`.
    approach_mm
        Travel since first touch.
    radius_mm
        Radius of the contact; the face's radius when it covers the face, NaN when it opens inside.
    """

    force: Floats
    pressure_kpa: Floats
    approach_mm: float
    radius_mm: float

    def __mul__(self, factor: float) -> PartialContact:
        return PartialContact(
            force=factor * self.force,
            pressure_kpa=factor * self.pressure_kpa,
            approach_mm=factor * self.approach_mm,
            radius_mm=self.radius_mm,
        )

    def __add__(self, other: PartialContact) -> PartialContact:
        return PartialContact(
            force=self.force + other.force,
            pressure_kpa=self.pressure_kpa + other.pressure_kpa,
            approach_mm=self.approach_mm + other.approach_mm,
            radius_mm=max(self.radius_mm, other.radius_mm),
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FullContact:
    """All contacts that cover the face: ``shape + force * unit`` at a force of at least ``force_mn``."""

    unit: PartialContact  # contact by one newton
    shape: PartialContact | None  # self-equilibrated contact by a dome's gap; None when the face is flat
    force_mn: float  # force at which the contact covers the face, mN; 0 when the face is flat


class FaceContact:
    """The contact face of one probe, with all values that do not depend on the tissue.

    Pressures are averaged around the radii ``radius_mm``, shape (k,), from 0 to the edge.
    """

    def __init__(self, probe: Probe, face: Face, radius_mm: Floats) -> None:
        self.probe, self.face, self.radius_mm = probe, face, radius_mm
        self.is_domed = probe.face_curvature_mm is not None
        self.inner = radius_mm < EDGE_FRACTION * probe.radius_mm
        self._closed_pressure = face.averages(radius_mm) @ np.linalg.inv(face.mass())

    def touch(self, compliance: Floats, force_mn: float, split: Elastic | None = None) -> PartialContact:
        """The contact under ``force_mn`` > 0.

        ``compliance`` is that of both bodies on the face's nodes, mm/mN, (n, n); ``split`` is the same with the
        tissue's half-space split off, which a domed face needs.
        """
        touch = self._closed(compliance, force_mn) if split is None else self._domed(compliance, split, force_mn)
        pull = -PULL * force_mn / (np.pi * self.probe.radius_mm**2)
        return touch if touch.pressure_kpa[self.inner].min() >= pull else self._opening(compliance, force_mn)

    def covering(self, compliance: Floats, split: Elastic | None = None) -> FullContact:
        """The contacts that cover the face, also with tension; arguments as for `touch`."""
        unit = self._closed(compliance, MN_PER_N)
        if split is None:
            return FullContact(unit=unit, shape=None, force_mn=0.0)
        whole = on_disc(split, self._whole_disc, self.probe.radius_mm)
        force_mn = float(whole.force.sum())
        return FullContact(unit=unit, shape=self._of_disc(whole) + unit * (-force_mn / MN_PER_N), force_mn=force_mn)

    def closed_pressure(self, force: Floats) -> Floats:
        """Mean pressures from nodal forces of a contact that covers the face; ``force`` may have columns."""
        return self._closed_pressure @ force

    def _closed(self, compliance: Floats, force_mn: float) -> PartialContact:
        """The contact when the whole face travels by one amount."""
        force = np.asarray(np.linalg.solve(compliance, np.ones(len(compliance))), dtype=float)
        approach = force_mn / force.sum()
        force *= approach
        return PartialContact(
            force=force,
            pressure_kpa=self.closed_pressure(force),
            approach_mm=float(approach),
            radius_mm=self.probe.radius_mm,
        )

    def _domed(self, compliance: Floats, split: Elastic, force_mn: float) -> PartialContact:
        edge = self.probe.radius_mm
        whole = on_disc(split, self._whole_disc, edge)
        rest = force_mn - float(whole.force.sum())
        if rest >= 0:  # the contact covers the face
            touch = self._of_disc(whole)
            return touch + self._closed(compliance, rest) if rest else touch
        return self._of_disc(under_force(split, self.face, self.probe.sag_mm, force_mn, largest=whole))

    @cached_property
    def _whole_disc(self) -> Loads:
        return loads(self.face, self.probe.sag_mm, self.probe.radius_mm)

    def _of_disc(self, disc: DiscContact) -> PartialContact:
        is_whole = disc.radius_mm == self.probe.radius_mm
        means_of_terms = self._whole_disc_means if is_whole else self._disc_means(disc.radius_mm)
        return PartialContact(
            force=disc.force,
            pressure_kpa=means_of_terms @ disc.terms,
            approach_mm=disc.approach_mm,
            radius_mm=disc.radius_mm,
        )

    @cached_property
    def _whole_disc_means(self) -> Floats:
        return self._disc_means(self.probe.radius_mm)

    def _disc_means(self, disc_mm: float) -> Floats:
        """Mean pressures from 1 kPa of each term on a disc of radius ``disc_mm``, shape (k, terms)."""
        angle, weight = disc_points(self.radius_mm, disc_mm, 3)
        inside = disc_mm * np.sin(angle)
        area = 2 * np.pi * inside * disc_mm * np.cos(angle) * weight
        return means(self.radius_mm, inside, area, regular_terms(angle))

    def _opening(self, compliance: Floats, force_mn: float) -> PartialContact:
        """Contact anywhere: pressures >= 0 and linear between the nodes, gaps closed in their mean."""
        area, nodal, gap = self._opening_loads
        unit = nodal / area  # nodal forces of 1 mN on each node's hat
        response = unit.T @ compliance @ unit

        def push(approach: float) -> Floats:
            return unilateral_contact(response, gap / area, approach)[0]

        if self.is_domed:
            far = 10 * (gap / area).max()
            while push(far).sum() < force_mn:
                far *= 2
            approach = float(
                scipy.optimize.brentq(lambda travel: push(travel).sum() - force_mn, 0.0, far, xtol=1e-12 * far)
            )
        else:
            approach = force_mn / float(push(1.0).sum())  # flat contacts are proportional
        hat_force = push(approach)
        inside, ring = ring_points(np.union1d(self.radius_mm, self.face.radius_mm))
        values = hats(self.face.radius_mm, inside) @ (hat_force / area)
        return PartialContact(
            force=unit @ hat_force,
            pressure_kpa=means(self.radius_mm, inside, ring, values[:, None])[:, 0],
            approach_mm=approach,
            radius_mm=np.nan,
        )

    @cached_property
    def _opening_loads(self) -> tuple[Floats, Floats, Floats]:
        """Area of each node's hat, its nodal forces at 1 kPa (n, n), and the gap weighted by it."""
        inside, ring = ring_points(self.face.radius_mm)
        weighted = ring[:, None] * hats(self.face.radius_mm, inside)
        return weighted.sum(axis=0), self.face.interpolation(inside).T @ weighted, self.probe.sag_mm(inside) @ weighted
