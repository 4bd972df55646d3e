"""The energy of bodies in contact, and Newton's method along the load.

Pressures of the contacts and of nearly incompressible material are unknowns beside the displacements. A large step
then spoils neither the tangent nor the set of closed contacts. A step that leads to det F <= 0 is shortened.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.errors import MechanicsError
from tsis.model.press import MN_PER_N

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from tsis.mechanics.finite_strain.neo_hookean import ElasticBody, Tangent
    from tsis.mechanics.finite_strain.sliding import Linearised, SlidingContact
    from tsis.mechanics.mesh import Floats, Integers


if TYPE_CHECKING:
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


DECREMENT = 1e-9  # of the stored energy: largest gain of Newton's last step
TOUCHING = 1e-1  # the same at the first touch
ROUGH = 1e-6  # the same between the requested loads
ROUNDS = 25
TOUCHES = 12
MOST_STALLED_STEPS = 5  # Newton steps without an improvement
SMALLEST_FRACTION = 1 / 64
SMALLEST_STEP = 1e-3  # of the next force
FIRST_STEP = 0.35  # of the largest force
FIRST_GROWTH = 5.0  # of the force at the first touch
GROWTH = 2.0
EASY_ROUNDS = 9  # a step with no more rounds is followed by a larger step


class StalledError(MechanicsError):
    """Newton's method does not converge, for no reason that the last state shows."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class State:
    """A state of equilibrium.

    Attributes
    ----------
    unknowns
        All unknowns, mm.
    pressures
        Volumetric stress of the elements and pressures of the contacts, kPa.
    load
        The load in equilibrium.
    model
        The energy's quadratic model near the state.
    rounds
        Number of Newton steps.
    """

    unknowns: Floats
    pressures: Pressures
    load: Load
    model: Quadratic
    rounds: int


def solve_equilibrium(
    potential: Potential, start: Floats, pressures: Pressures, load: Load, *, decrement: float = DECREMENT
) -> State | None:
    """Newton's method from ``start``; None without convergence to a minimum of the energy."""
    unknowns, slopes = start, [np.inf]
    if not np.isfinite(potential.stored(unknowns)):
        return None
    for count in range(1, ROUNDS + 1):
        model = potential.quadratic(unknowns, pressures, load)
        step = model.step()
        slope = abs(model.slope(step))
        fraction = _upright(potential, unknowns, step)
        if (
            not np.isfinite(slope)
            or fraction is None
            or (count > MOST_STALLED_STEPS and min(slopes[-MOST_STALLED_STEPS:]) > min(slopes[:-MOST_STALLED_STEPS]))
        ):
            return None
        slopes.append(slope)
        full = model.pressures(step)
        pressures = tuple(old + fraction * (new - old) for old, new in zip(pressures, full, strict=True))
        unknowns = unknowns + fraction * step
        if slope < decrement * max(abs(potential.energy(unknowns, load)), 1e-9) and fraction == 1.0:
            state = State(unknowns=unknowns, pressures=pressures, load=load, model=model, rounds=count)
            return state if model.stable else None
    return None


def _upright(potential: Potential, unknowns: Floats, step: Floats) -> float | None:
    """Largest fraction 2**-k of ``step`` with det F > 0 in all elements."""
    fraction = 1.0
    while not potential.upright(unknowns + fraction * step):
        fraction /= 2
        if fraction < SMALLEST_FRACTION:
            return None
    return fraction


def find_first_contact(
    potential: Potential, shifted: Callable[[float], Floats], travel_mm: float, spring: float, *, below_mn: float
) -> State:
    """The first contact, roughly: a stiff spring pulls the bodies together.

    Parameters
    ----------
    potential
        Bodies, contacts and travel.
    shifted
        Unknowns of undeformed bodies at a travel.
    travel_mm
        Initial travel; halved until Newton's method converges and the force stays below ``below_mn``.
    spring
        Stiffness of the spring, mN/mm.
    below_mn
        Largest force in mN.
    """
    for _ in range(TOUCHES):
        start = shifted(travel_mm)
        zeros = tuple(np.zeros_like(pressure) for pressure in potential.pressures(start))
        load = Load(spring=spring, travel_mm=travel_mm)
        state = solve_equilibrium(potential, start, zeros, load, decrement=TOUCHING)
        if state is not None and potential.reaction(state.unknowns, load) < below_mn:
            return state
        travel_mm /= 2 if state is None else max(2.0, potential.reaction(state.unknowns, load) / below_mn)
    raise MechanicsError("the first touch of this press does not converge; choose another resolution")


def follow_load_path(
    potential: Potential,
    first: State,
    forces_mn: Sequence[float],
    *,
    refuse: Callable[[State], str | None],
    explain: Callable[[State], str | None] = lambda _: None,
) -> Iterator[State]:
    """Equilibrium at each of the ascending ``forces_mn``, with adaptive steps between them.

    Parameters
    ----------
    potential
        Bodies, contacts and travel.
    first
        The first contact.
    forces_mn
        Ascending forces in mN.
    refuse
        Reason why a state lies outside the model's range, or None.
    explain
        Reason why nothing may converge beyond a state, or None.

    Raises
    ------
    MechanicsError
        When a load does not converge or is refused; the message names the last valid load.
    StalledError
        When a load does not converge and ``explain`` finds no reason.
    """
    state, force, before = first, potential.reaction(first.unknowns, first.load), None
    largest = float(forces_mn[-1])
    step = min(FIRST_STEP * largest, FIRST_GROWTH * force)
    for target in forces_mn:
        while force < target:
            left = target - force
            next_force = target if step > 0.8 * left else force + (step if step < 0.5 * left else left / 2)
            start = _ahead(potential, state, before, next_force)
            exact = DECREMENT if next_force == target else ROUGH
            equilibrium = solve_equilibrium(potential, *start, Load(force_mn=next_force), decrement=exact)
            if equilibrium is None:
                step, before = (next_force - force) / 2, None
                if step < SMALLEST_STEP * next_force:
                    reason = explain(state)
                    cause = f" because {reason}" if reason else ""
                    problem = f"the press does not converge at {next_force / MN_PER_N:.3g} N{cause}"
                    raise (MechanicsError if reason else StalledError)(_last(problem, force))
                continue
            reason = refuse(equilibrium)
            if reason is not None:
                raise MechanicsError(_last(f"{reason} at {next_force / MN_PER_N:.3g} N", force))
            step = (next_force - force) * (GROWTH if equilibrium.rounds <= EASY_ROUNDS else 1.0)
            before = state if state is not first else None
            state, force = equilibrium, next_force
        yield state


def _ahead(potential: Potential, state: State, before: State | None, force_mn: float) -> tuple[Floats, Pressures]:
    """Prediction for a larger force: parabola along the tangent through the state before, or the tangent alone."""
    tangent = state.model.solution(potential.travel)
    ahead = force_mn - potential.reaction(state.unknowns, state.load)

    def follow(now: Floats, rate: Floats, then: Floats) -> Floats:
        if before is None:
            return now + ahead * rate
        back = state.load.force_mn - before.load.force_mn
        bend = (then - now + back * rate) / back**2
        return np.asarray(now + ahead * rate + ahead**2 * bend)

    rates = state.model.pressures_by(tangent)
    past = state if before is None else before
    pressures = tuple(follow(*three) for three in zip(state.pressures, rates, past.pressures, strict=True))
    return follow(state.unknowns, tangent, past.unknowns), pressures


def rounded_down(force: float) -> float:
    """A force rounded down to three digits, so that it converges too."""
    digits = 10.0 ** (2 - np.floor(np.log10(force)))
    return float(np.floor(force * digits) / digits)


def _last(problem: str, force_mn: float) -> str:
    valid = rounded_down(force_mn) / MN_PER_N
    return f"{problem}; the last load that converged is {valid:.3g} N: choose at most that"
