"""Unilateral contact: the closed nodes of a face and their forces.

The bodies are condensed onto the face, so contact is a small linear complementarity problem: at each node the gap is
closed with a force >= 0, or open without force. With a positive definite compliance it has one solution.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.errors import InputError, MechanicsError
from tsis.mechanics._face import EDGE_FRACTION, hats, means, ring_points
from tsis.mechanics.small_strain import _disc_contact as disc_contact
from tsis.model.press import MN_PER_N
from tsis.model.require import require_array, require_number

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from tsis.mechanics._element import Booleans, Floats
    from tsis.mechanics._face import Face
    from tsis.model.probe import Probe


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

    def touch(self, compliance: Floats, force_mn: float, split: disc_contact.Elastic | None = None) -> PartialContact:
        """The contact under ``force_mn`` > 0.

        ``compliance`` is that of both bodies on the face's nodes, mm/mN, (n, n); ``split`` is the same with the
        tissue's half-space split off, which a domed face needs.
        """
        touch = self._closed(compliance, force_mn) if split is None else self._domed(compliance, split, force_mn)
        pull = -PULL * force_mn / (np.pi * self.probe.radius_mm**2)
        return touch if touch.pressure_kpa[self.inner].min() >= pull else self._opening(compliance, force_mn)

    def covering(self, compliance: Floats, split: disc_contact.Elastic | None = None) -> FullContact:
        """The contacts that cover the face, also with tension; arguments as for `touch`."""
        unit = self._closed(compliance, MN_PER_N)
        if split is None:
            return FullContact(unit=unit, shape=None, force_mn=0.0)
        whole = disc_contact.on_disc(split, self._whole_disc, self.probe.radius_mm)
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

    def _domed(self, compliance: Floats, split: disc_contact.Elastic, force_mn: float) -> PartialContact:
        edge = self.probe.radius_mm
        whole = disc_contact.on_disc(split, self._whole_disc, edge)
        rest = force_mn - float(whole.force.sum())
        if rest >= 0:  # the contact covers the face
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
    def _whole_disc_means(self) -> Floats:
        return self._disc_means(self.probe.radius_mm)

    def _disc_means(self, disc_mm: float) -> Floats:
        """Mean pressures from 1 kPa of each term on a disc of radius ``disc_mm``, shape (k, terms)."""
        angle, weight = disc_contact.disc_points(self.radius_mm, disc_mm, 3)
        inside = disc_mm * np.sin(angle)
        area = 2 * np.pi * inside * disc_mm * np.cos(angle) * weight
        return means(self.radius_mm, inside, area, disc_contact.regular_terms(angle))

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
