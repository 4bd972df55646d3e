"""The total energy of bodies in contact, and its Newton step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.mechanics._element import Floats, Integers
    from tsis.mechanics.finite_strain._contact import Linearised, SlidingContact
    from tsis.mechanics.finite_strain._elastic_body import ElasticBody, Tangent

    Pressures = tuple[Floats, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Load:
    """The drive of the travel: a force, or a stiff spring pulled to a travel (then ``force_mn`` is 0)."""

    force_mn: float = 0.0
    spring: float = 0.0
    travel_mm: float = 0.0

    def energy(self, travel: float) -> float:
        """Energy of the drive in mN mm."""
        return self.spring / 2 * (travel - self.travel_mm) ** 2 - self.force_mn * travel


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Quadratic:
    """The energy's second-order model at one state, factorised."""

    gradient: Floats  # gradient by the skeleton's unknowns, mN
    factors: scipy.sparse.linalg.SuperLU  # LU factors of the condensed tangent with permuted rows and columns
    permutation: Integers
    elements: Tangent
    body: ElasticBody
    contacts: tuple[tuple[float, Integers, Linearised], ...]

    def pressures(self, step: Floats) -> Pressures:
        """Pressures after ``step``, by the linearised gaps, kPa."""
        current = tuple(-stiffness * contact.gap_mm for stiffness, _, contact in self.contacts)
        rates = self.pressures_by(step)
        bulk = self.body.volumetric_stress_at(self.elements.gradient)
        return (bulk + rates[0], *(now + rate for now, rate in zip(current, rates[1:], strict=True)))

    def pressures_by(self, direction: Floats) -> Pressures:
        """Change of the pressures along ``direction``, kPa."""
        padded = np.append(direction, 0.0)
        bulk = self.body.volumetric_change(self.elements.gradient, self.body.numbering.displacements(direction))
        return (
            bulk,
            *(-stiffness * (contact.slope @ padded[touching]) for stiffness, touching, contact in self.contacts),
        )

    @property
    def stable(self) -> bool:
        """Whether the energy has a minimum: all pivots are positive."""
        return bool(self.factors.U.diagonal().min() > 0)

    def step(self) -> Floats:
        """Newton's step of all unknowns."""
        return self._complete(self._solve(-self.gradient), self.elements.rest)

    def slope(self, step: Floats) -> float:
        """Derivative of the energy along Newton's ``step``, mN mm."""
        return float(self.gradient @ step[: len(self.gradient)]) + self.elements.relief

    def solution(self, unknown: int) -> Floats:
        """Response of all unknowns to a unit force on one of the skeleton's, mm/mN."""
        force = np.zeros(len(self.gradient))
        force[unknown] = 1.0
        return self._complete(self._solve(force), np.zeros_like(self.elements.rest))

    def _solve(self, right: Floats) -> Floats:
        result = np.empty_like(right)
        result[self.permutation] = self.factors.solve(right[self.permutation])
        return result

    def _complete(self, skeleton: Floats, rest: Floats) -> Floats:
        local = np.append(skeleton, 0.0)[self.body.element_unknowns]
        inside = rest - (self.elements.back @ local[..., None])[..., 0]
        return np.concatenate([skeleton, inside.ravel()])


class Potential:
    """Elastic bodies, their contacts, and the index of the driven unknown ``travel`` (mm)."""

    def __init__(self, body: ElasticBody, contacts: Sequence[SlidingContact], travel: int) -> None:
        self.body, self.contacts, self.travel = body, tuple(contacts), travel
        self.size = body.numbering.total
        skeleton = body.numbering.skeleton
        self._touching = [body.numbering.of_node[contact.nodes].ravel() for contact in self.contacts]
        groups = [body.element_unknowns, *(unknowns[None] for unknowns in self._touching)]
        rows = np.concatenate([np.repeat(group, group.shape[1], axis=1).ravel() for group in groups])
        columns = np.concatenate([np.tile(group, (1, group.shape[1])).ravel() for group in groups])
        rows, columns = np.append(rows, travel), np.append(columns, travel)
        self._cached = (rows >= 0) & (columns >= 0)
        rows, columns = rows[self._cached], columns[self._cached]
        self._permutation = _ordering(rows, columns, skeleton)
        position = np.empty(skeleton, dtype=np.int64)
        position[self._permutation] = np.arange(skeleton)
        key, self._slot = np.unique(position[columns] * skeleton + position[rows], return_inverse=True)
        self._rows = (key % skeleton).astype(np.int32)
        self._starts = np.searchsorted(key // skeleton, np.arange(skeleton + 1)).astype(np.int32)

    def displacements(self, unknowns: Floats) -> Floats:
        """Displacements of all nodes, mm."""
        return self.body.numbering.displacements(unknowns)

    def positions(self, unknowns: Floats) -> Floats:
        """Positions of all nodes, mm."""
        return np.asarray(self.body.solid.nodes + self.displacements(unknowns))

    def upright(self, unknowns: Floats) -> bool:
        """Whether det F > 0 in all elements."""
        return bool(np.isfinite(self.body.energy(self.displacements(unknowns))))

    def stored(self, unknowns: Floats) -> float:
        """Strain energy of the bodies and of the contact's springs, mN mm."""
        strain = self.body.energy(self.displacements(unknowns))
        if not np.isfinite(strain):
            return strain
        positions = self.positions(unknowns)
        return strain + sum(contact.energy(positions) for contact in self.contacts)

    def reaction(self, state_unknowns: Floats, load: Load) -> float:
        """Force in mN with which the load drives the travel."""
        return load.force_mn - load.spring * (float(state_unknowns[self.travel]) - load.travel_mm)

    def energy(self, unknowns: Floats, load: Load) -> float:
        """Total energy, mN mm."""
        return self.stored(unknowns) + load.energy(float(unknowns[self.travel]))

    def pressures(self, unknowns: Floats) -> Pressures:
        """Volumetric stress and pressures from the overlaps of the contacts, kPa."""
        positions = self.positions(unknowns)
        bulk = self.body.volumetric_stress(self.displacements(unknowns))
        return (bulk, *(contact.pressure(positions) for contact in self.contacts))

    def quadratic(self, unknowns: Floats, pressures: Pressures, load: Load) -> Quadratic:
        """Gradient and factorised tangent at ``unknowns`` and contact ``pressures``."""
        tangent = self.body.tangent(self.displacements(unknowns), pressures[0])
        positions = self.positions(unknowns)
        skeleton = self.body.numbering.skeleton
        gradient = np.zeros(skeleton + 1)  # the last entry collects fixed directions
        np.add.at(gradient, self.body.element_unknowns, tangent.forces)
        values, contacts = [tangent.matrices.ravel()], []
        for contact, touching, pressure in zip(self.contacts, self._touching, pressures[1:], strict=True):
            linear = contact.derivatives(positions, pressure)
            np.add.at(gradient, touching, linear.forces)
            values.append(linear.matrix.ravel())
            contacts.append((contact.stiffness, touching, linear))
        gradient = gradient[:-1]
        gradient[self.travel] += load.spring * (unknowns[self.travel] - load.travel_mm) - load.force_mn
        data = np.append(np.concatenate(values), load.spring)[self._cached]
        summed = np.bincount(self._slot, weights=data, minlength=len(self._rows))
        matrix = scipy.sparse.csc_array((summed, self._rows, self._starts), shape=(skeleton, skeleton))
        factors = scipy.sparse.linalg.splu(
            matrix, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True, "Equil": False}
        )
        return Quadratic(
            gradient=gradient,
            factors=factors,
            permutation=self._permutation,
            elements=tangent,
            body=self.body,
            contacts=tuple(contacts),
        )


def _ordering(rows: Integers, columns: Integers, size: int) -> Integers:
    """An elimination order with sparse factors."""
    ones = scipy.sparse.csc_array((np.ones(len(rows)), (rows, columns)), shape=(size, size))
    ones.data[:] = -1.0
    ones.setdiag(2.0 * np.diff(ones.indptr))
    factors = scipy.sparse.linalg.splu(
        scipy.sparse.csc_array(ones), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
    return np.argsort(factors.perm_c).astype(np.int64)
