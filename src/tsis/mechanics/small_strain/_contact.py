"""Contact that can open: which nodes of a face touch, and with what force.

The bodies are condensed onto the face, so contact is a small linear complementarity problem: at each node either the
gap is closed and pushes, or it is open and nothing acts. With a positive definite compliance it has one solution.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq

from tsis.errors import InputError, MechanicsError
from tsis.mechanics._face import EDGE_FRACTION, hats, means, ring_points
from tsis.mechanics.small_strain import _disc_contact as disc_contact
from tsis.model import MN_PER_N, require_array, require_number

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from tsis.mechanics._face import Face
    from tsis.model import Probe


ROUNDING = 1e-12  # forces and gaps this small, relative to the largest, have no sign
MOST_STALLED_EXCHANGES = 3  # exchanges of all wrong nodes without progress before single ones are exchanged


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ContactDiagnostics:
    """How a contact was found.

    Attributes
    ----------
    closed
        Whether each node touches, shape (n,).
    gap_mm
        Gap that is left at each node, shape (n,), mm; zero where closed.
    iterations
        Linear solves.
    """

    closed: NDArray[np.bool]
    gap_mm: NDArray[np.float64]
    iterations: int


def unilateral_contact(
    compliance: ArrayLike, gap_mm: ArrayLike, approach_mm: float
) -> tuple[NDArray[np.float64], ContactDiagnostics]:
    """Nodal forces when two bodies approach each other and may touch but not pull.

    Finds ``f >= 0`` and ``gap = C f + gap_mm - approach_mm >= 0`` with ``f * gap = 0`` node by node, by block principal
    pivoting (Judice and Pires 1994): solve for the nodes taken as closed, exchange those whose force or gap is
    negative. When exchanging all of them stops helping, the last one alone is exchanged, which always ends.

    Parameters
    ----------
    compliance
        Displacement of the nodes by nodal forces, both bodies added, mm/mN; symmetric positive definite, shape (n, n).
    gap_mm
        Gap of the undeformed bodies at first touch, mm, shape (n,).
    approach_mm
        Travel since first touch, mm, in [-1e6, 1e6].

    Returns
    -------
    force : ndarray
        Nodal forces, mN, shape (n,), >= 0.
    diagnostics : ContactDiagnostics
        The nodes that touch, and the gaps.

    Raises
    ------
    InputError
        When the shapes do not belong together.
    MechanicsError
        When no contact is found, which a positive definite compliance excludes.

    Examples
    --------
    >>> force, found = unilateral_contact([[2.0, 1.0], [1.0, 2.0]], [0.0, 3.0], 1.0)
    >>> force.tolist(), found.gap_mm.tolist()
    ([0.5, 0.0], [0.0, 2.5])
    """
    matrix = require_array("compliance", compliance, ndim=2)
    gap = require_array("gap_mm", gap_mm, ndim=1)
    approach = require_number("approach_mm", approach_mm, -1e6, 1e6, hint="millimetres")
    if matrix.shape != (gap.size, gap.size):
        raise InputError(f"compliance must have shape ({gap.size}, {gap.size}), as gap_mm has; got {matrix.shape}")
    overlap = approach - gap
    closed, fewest, timeouts = overlap > 0, gap.size + 1, MOST_STALLED_EXCHANGES
    for iteration in range(1, 100 + 10 * gap.size):
        force = np.zeros(gap.size)
        force[closed] = np.linalg.solve(matrix[np.ix_(closed, closed)], overlap[closed])
        left = np.where(closed, 0.0, matrix @ force - overlap)
        wrong = (force < -ROUNDING * np.abs(force).max()) | (left < -ROUNDING * np.abs(overlap).max())
        count = int(np.count_nonzero(wrong))
        if count == 0:
            return np.maximum(force, 0.0), ContactDiagnostics(closed=closed, gap_mm=left, iterations=iteration)
        if count < fewest:
            fewest, timeouts = count, MOST_STALLED_EXCHANGES
        else:
            timeouts -= 1
        if timeouts < 0:
            wrong[: np.flatnonzero(wrong)[-1]] = False
        closed = closed ^ wrong
    raise MechanicsError("compliance must be symmetric positive definite for a contact to exist; none was found")


PULL = 1e-6  # pressures this far below zero, relative to the mean, are rounding


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PartialContact:
    """One contact.

    Attributes
    ----------
    force
        Forces on the face's nodes, mN, shape (n,).
    pressure_kpa
        Mean pressures around the radii asked for.
    approach_mm
        Travel since first touch.
    radius_mm
        Where the contact ends; the face's radius when it covers the face, NaN when it opens inside.
    """

    force: NDArray[np.float64]
    pressure_kpa: NDArray[np.float64]
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
    """All contacts that cover the face: ``shape + force * unit``, the force being at least ``force_mn``.

    Attributes
    ----------
    unit
        What each newton adds.
    shape
        What a dome's gap adds, in equilibrium with itself; None when the face is flat.
    force_mn
        Force that makes the contact reach the rim, mN; 0 when the face is flat.
    """

    unit: PartialContact
    shape: PartialContact | None
    force_mn: float


class FaceContact:
    """The contact face of one probe, and everything about it that no tissue changes.

    Parameters
    ----------
    probe, face
        The probe, whose undeformed gap it is, and the mesh of its face.
    radius_mm
        Radii from 0 to the edge around which pressures are averaged, shape (k,).
    """

    def __init__(self, probe: Probe, face: Face, radius_mm: NDArray[np.float64]) -> None:
        self.probe, self.face, self.radius_mm = probe, face, radius_mm
        self.is_domed = probe.face_curvature_mm is not None
        self.inner = radius_mm < EDGE_FRACTION * probe.radius_mm
        self._closed_pressure = face.averages(radius_mm) @ np.linalg.inv(face.mass())

    def touch(
        self, compliance: NDArray[np.float64], force_mn: float, split: disc_contact.Elastic | None = None
    ) -> PartialContact:
        """The contact under ``force_mn``.

        Parameters
        ----------
        compliance
            Of both bodies together on the face's nodes, mm/mN, shape (n, n).
        force_mn
            Total force, mN, > 0.
        split
            The same, with the tissue's half-space split off; a domed face needs it.
        """
        touch = self._closed(compliance, force_mn) if split is None else self._domed(compliance, split, force_mn)
        pull = -PULL * force_mn / (np.pi * self.probe.radius_mm**2)
        return touch if touch.pressure_kpa[self.inner].min() >= pull else self._opening(compliance, force_mn)

    def covering(self, compliance: NDArray[np.float64], split: disc_contact.Elastic | None = None) -> FullContact:
        """The contacts that cover the face, whether or not the tissue would have to pull; arguments as for `touch`."""
        unit = self._closed(compliance, MN_PER_N)
        if split is None:
            return FullContact(unit=unit, shape=None, force_mn=0.0)
        whole = disc_contact.on_disc(split, self._whole_disc, self.probe.radius_mm)
        force_mn = float(whole.force.sum())
        return FullContact(unit=unit, shape=self._of_disc(whole) + unit * (-force_mn / MN_PER_N), force_mn=force_mn)

    def closed_pressure(self, force: NDArray[np.float64]) -> NDArray[np.float64]:
        """Mean pressures of nodal forces of a contact that covers the face; columns are mapped one by one."""
        return self._closed_pressure @ force

    def _closed(self, compliance: NDArray[np.float64], force_mn: float) -> PartialContact:
        """The whole face travels by one amount."""
        force = np.asarray(np.linalg.solve(compliance, np.ones(len(compliance))), dtype=float)
        approach = force_mn / force.sum()
        force *= approach
        return PartialContact(
            force=force,
            pressure_kpa=self.closed_pressure(force),
            approach_mm=float(approach),
            radius_mm=self.probe.radius_mm,
        )

    def _domed(self, compliance: NDArray[np.float64], split: disc_contact.Elastic, force_mn: float) -> PartialContact:
        edge = self.probe.radius_mm
        whole = disc_contact.on_disc(split, self._whole_disc, edge)
        rest = force_mn - float(whole.force.sum())
        if rest >= 0:  # once the rim touches, more force presses a closed face
            touch = self._of_disc(whole)
            return touch + self._closed(compliance, rest) if rest else touch
        return self._of_disc(disc_contact.under_force(split, self.face, self.probe.sag_mm, force_mn, largest=whole))

    @cached_property
    def _whole_disc(self) -> disc_contact.Loads:
        return disc_contact.loads(self.face, self.probe.sag_mm, self.probe.radius_mm)

    def _of_disc(self, disc: disc_contact.DiscContact) -> PartialContact:
        is_whole = disc.radius_mm == self.probe.radius_mm
        means_of_terms = self._whole_disc_means if is_whole else self._disc_means(disc.radius_mm)
        return PartialContact(
            force=disc.force,
            pressure_kpa=means_of_terms @ disc.terms,
            approach_mm=disc.approach_mm,
            radius_mm=disc.radius_mm,
        )

    @cached_property
    def _whole_disc_means(self) -> NDArray[np.float64]:
        return self._disc_means(self.probe.radius_mm)

    def _disc_means(self, disc_mm: float) -> NDArray[np.float64]:
        """Mean pressures by 1 kPa of each term on a disc of radius ``disc_mm``, shape (k, terms)."""
        angle, weight = disc_contact.disc_points(self.radius_mm, disc_mm, 3)
        inside = disc_mm * np.sin(angle)
        area = 2 * np.pi * inside * disc_mm * np.cos(angle) * weight
        return means(self.radius_mm, inside, area, disc_contact.regular_terms(angle))

    def _opening(self, compliance: NDArray[np.float64], force_mn: float) -> PartialContact:
        """Contact anywhere: pressures linear between the nodes and never negative, gaps closed in their mean."""
        area, nodal, gap = self._opening_loads
        item = nodal / area  # nodal forces of 1 mN on each node's hat
        response = item.T @ compliance @ item

        def push(approach: float) -> NDArray[np.float64]:
            return unilateral_contact(response, gap / area, approach)[0]

        if self.is_domed:
            far = 10 * (gap / area).max()
            while push(far).sum() < force_mn:
                far *= 2
            approach = float(brentq(lambda travel: push(travel).sum() - force_mn, 0.0, far, xtol=1e-12 * far))
        else:
            approach = force_mn / float(push(1.0).sum())  # all flat contacts are alike
        hat_force = push(approach)
        inside, ring = ring_points(np.union1d(self.radius_mm, self.face.radius_mm))
        values = hats(self.face.radius_mm, inside) @ (hat_force / area)
        return PartialContact(
            force=item @ hat_force,
            pressure_kpa=means(self.radius_mm, inside, ring, values[:, None])[:, 0],
            approach_mm=approach,
            radius_mm=np.nan,
        )

    @cached_property
    def _opening_loads(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Of each node's hat: its area, its nodal forces at 1 kPa (n, n), and the gap weighted by it."""
        inside, ring = ring_points(self.face.radius_mm)
        weighted = ring[:, None] * hats(self.face.radius_mm, inside)
        return weighted.sum(axis=0), self.face.interpolation(inside).T @ weighted, self.probe.sag_mm(inside) @ weighted
