"""Contact over a disc whose edge lies anywhere: no node decides where it ends.

Inside the disc of radius a the pressure is ``sqrt(1 - s**2)`` times a polynomial in ``s**2``, s = r / a, as it is under
every smooth body (Hertz is the constant). Demanding that the gap is closed in the mean, weighted by each of these
pressures and by ``1 / sqrt(1 - s**2)`` too, is the stationarity of the energy, the last of them its stationarity by a:
the contact ends where the pressure runs out.

What a half-space answers to these pressures is known exactly (Copson 1947), and no mesh resolves the kink at an edge
that lies inside its elements. So the compliance is split: the half-space exactly, and what layers, walls, inclusion
and probe change about it, which is smooth, by the difference of two compliances from ONE mesh.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import MechanicsError
from tsis.mechanics._element import gauss_points
from tsis.model import MN_PER_N

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from tsis.mechanics._face import Face


TERMS = 10  # polynomials in s**2
POINTS = 28  # Gauss points over the disc, which integrate all terms to rounding,
FEWEST = 13  # and between two lines of the face
SMALLEST = np.log(1e-3)  # of the contact radius that is looked for, as a share of the face's
FORCE_POWER = 2.7  # of the radius that the force grows with; 3 under a rigid dome on a half-space
STEPS = 60
ROUNDING = 1e-11  # of the force
TINY = 1e-300


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DiscContact:
    """A contact that ends at ``radius_mm``.

    Attributes
    ----------
    radius_mm
        Where the pressure runs out.
    terms
        Factors of the pressure's terms, kPa, shape (terms,).
    force
        Forces on the face's nodes, mN, shape (n,).
    approach_mm
        Travel since first touch.
    """

    radius_mm: float
    terms: NDArray[np.float64]
    force: NDArray[np.float64]
    approach_mm: float

    def pressure_kpa(self, radius_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pressure at ``radius_mm``, zero outside the contact."""
        angle = np.arcsin(np.minimum(radius_mm / self.radius_mm, 1.0))
        return regular_terms(angle) @ self.terms


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Elastic:
    """Two bodies in contact.

    Attributes
    ----------
    half_space
        Compliance ``(1 - nu**2) / E`` in 1/kPa of the half-space that is answered exactly.
    smooth
        Compliance of the face's nodes, mm/mN, shape (n, n), of both bodies, less that of the half-space.
    """

    half_space: float
    smooth: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Loads:
    """What each term of the pressure does on a disc; the last column is the one that is infinite at its edge.

    Attributes
    ----------
    nodal
        Nodal forces by 1 kPa, shape (n, terms + 1).
    total
        Whole force by 1 kPa, shape (terms + 1,).
    gap
        Undeformed gap weighted by the term, mm mN/kPa, shape (terms + 1,).
    """

    nodal: NDArray[np.float64]
    total: NDArray[np.float64]
    gap: NDArray[np.float64]


def loads(face: Face, gap_mm: Callable[[NDArray[np.float64]], NDArray[np.float64]], radius_mm: float) -> Loads:
    """Integrate the terms over a disc, in the angle arcsin(r / a), in which even its edge is smooth."""
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


def disc_points(
    lines: NDArray[np.float64], radius_mm: float, points: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Gauss points and weights in the angle arcsin(r / a), between the ``lines`` that lie on the disc."""
    ends = np.arcsin(np.append(lines[lines < radius_mm], radius_mm) / radius_mm)
    x, w = gauss_points(points)
    half = np.diff(ends)[:, None] / 2
    return (ends[:-1, None] + half * (x + 1)).ravel(), (half * w).ravel()


def regular_terms(angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """The terms that are finite at the disc's edge, in the angle arcsin(r / a), shape (len(angle), terms)."""
    return np.asarray(np.cos(angle)[:, None] * _polynomials(angle))


def on_disc(contact: Elastic, on: Loads, radius_mm: float) -> DiscContact:
    """The contact that ends at ``radius_mm``, whatever force that takes."""
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
    contact: Elastic,
    face: Face,
    gap_mm: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    force_mn: float,
    *,
    largest: DiscContact,
) -> DiscContact:
    """The contact that carries ``force_mn``, less than what ``largest``, the contact of the whole face, carries."""
    # Secants in the logarithms, in which Hertz's law is a line; `largest` is the first point on it.
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
        f"force_n must be large enough for a contact that the mesh sees; {force_mn / MN_PER_N:g} N touch less than "
        f"{radius:.2g} mm; choose a larger force"
    )


@cache
def half_space_response() -> NDArray[np.float64]:
    """Work of each term's pressure (rows) on what each regular one displaces, for a = 1 and (1 - nu**2) / E = 1.

    With the Abel transforms h of both it is 8 times the integral of their product from 0 to a; (terms + 1, terms).
    """
    t, weight = _unit_points(2 * TERMS + 2)
    regular = _abel_transforms(t)
    every = np.column_stack([regular, np.full_like(t, np.pi / 2)])
    return np.asarray(8 * every.T @ (weight[:, None] * regular))


def displaced_outside(disc: DiscContact, radius_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Displacement of a half-space of (1 - nu**2) / E = 1 / kPa around the contact, at ``radius_mm`` beyond it, mm."""
    t, weight = _unit_points(4 * TERMS)
    angle, turn = np.pi * t / 2, np.pi * weight / 2
    fraction = np.sin(angle)
    transform = disc.radius_mm * (_abel_transforms(fraction) @ disc.terms)
    far = np.sqrt((radius_mm[:, None] / disc.radius_mm) ** 2 - fraction**2)
    return np.asarray(4 / np.pi * (1 / far) @ (turn * np.cos(angle) * transform))


def _abel_transforms(t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of each term, for a = 1: h(t), the integral of r p(r) / sqrt(r**2 - t**2) from t to a; shape (len(t), terms)."""
    x, weight = _unit_points(2 * TERMS + 2)
    angle, turn = np.pi * x / 2, np.pi * weight / 2
    there = np.arcsin(np.sqrt(t[:, None] ** 2 + (1 - t[:, None] ** 2) * np.sin(angle) ** 2))
    return np.asarray((1 - t[:, None] ** 2) * np.einsum("tak,a->tk", _polynomials(there), turn * np.cos(angle) ** 2))


def _unit_points(count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Gauss points and weights on [0, 1]."""
    x, w = gauss_points(count)
    return (x + 1) / 2, w / 2


def _polynomials(angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Chebyshev polynomials of 1 - 2 s**2, s being the sine of ``angle``, along a new last axis."""
    return np.asarray(np.cos(2 * angle[..., None] * np.arange(TERMS)))
