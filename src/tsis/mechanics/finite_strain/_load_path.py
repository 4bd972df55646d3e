"""Newton's method, repeated along the steps of the load.

Pressures of the contacts and of nearly incompressible material are unknowns beside the displacements. A large step
then spoils neither the tangent nor the set of closed contacts. A step that leads to det F <= 0 is shortened.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import MechanicsError
from tsis.mechanics.finite_strain._potential import Load, Potential, Quadratic
from tsis.model.press import MN_PER_N

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from tsis.mechanics._element import Floats
    from tsis.mechanics.finite_strain._potential import Pressures


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
