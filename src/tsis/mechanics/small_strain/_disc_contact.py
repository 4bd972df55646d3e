"""Contact over a disc whose edge need not lie on a node.

Inside the disc of radius a the pressure is ``sqrt(1 - s**2)`` times a polynomial in ``s**2``, s = r / a, as it is under
every smooth body (Hertz is the constant). The mean gap, weighted by each of these pressures and by
``1 / sqrt(1 - s**2)``, is zero: the energy is stationary. The last condition is its stationarity by a: the pressure
vanishes at the edge.

A half-space's response to these pressures has a closed form (Copson 1947), and no mesh resolves the kink at an edge
inside an element. So the compliance has two parts: the exact half-space, and the smooth change of it by layers, walls,
inclusion and probe, the difference of two compliances from ONE mesh.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import MechanicsError
from tsis.mechanics._element import Floats, gauss_points
from tsis.model.press import MN_PER_N

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.mechanics._face import Face


TERMS = 10  # polynomials in s**2
POINTS = 28  # Gauss points over the disc; they integrate all terms to rounding
FEWEST = 13  # Gauss points between two lines of the face
SMALLEST = np.log(1e-3)  # smallest contact radius over the face's
FORCE_POWER = 2.7  # power of the radius in the force; 3 under a rigid dome on a half-space
STEPS = 60
ROUNDING = 1e-11  # of the force
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
        if abs(excess) < ROUNDING:
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
