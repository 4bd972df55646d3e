"""Search for the layers and forces of most information.

New moduli need a new surrogate, in seconds; new forces do not, because a press is affine in its force. An inner search
therefore optimises the forces for each choice of moduli, between the force of full contact and the first limit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.errors import InputError
from tsis.inclusion.design.alternatives import CRITERIA, Design, calibration_for, design_of, score, with_moduli
from tsis.inclusion.design.information import even_inclusions, information_of, planned_view
from tsis.inclusion.design.limits import greatest_covering_force_n
from tsis.inclusion.design.protocol import LARGEST_FORCE_N, LEAST_FORCE_N
from tsis.inclusion.frames import largest_force_n
from tsis.model.require import require_integer, require_one_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.imaging.sensor import Sensor
    from tsis.inclusion.design.information import PlannedView
    from tsis.inclusion.design.protocol import Protocol
    from tsis.inclusion.prior import Floats, InclusionPrior
    from tsis.mechanics.surrogate.polynomial import Degrees
    from tsis.model.calibration import Calibration
    from tsis.model.probe import Probe


MOST_EVALUATIONS = 25
OCTAVES = 2.0  # the layers' common factor and their gradient lie between 1/4 and 4
SEARCHED = 16  # inclusions of the search; the result is evaluated on all
FORCE_EVALUATIONS = 30
WEAKEST = 0.05  # least force, of the strongest: a flat face has full contact at any force
CLIP_FRACTION = 0.98  # of full scale: inclusions between the searched ones may be slightly brighter
AT_END = 0.02  # of a range: distance from its end below which a variable is bound by it
HOPELESS = 1e3  # score of layers without a force within the limits


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DesignOptimum:
    """The best design of a search.

    Attributes
    ----------
    planned, best
        The initial design and the best one.
    stiffening
        Factor of all moduli.
    gradient
        Relative stiffening of the skin's end of the stack over the glass's.
    binding
        Binding limits: names of limits (``"strain"``, ``"contact"``, ``"saturation"``,
        ``"view"``) and of ends of the search (``"softest"``, ``"stiffest"``, ``"gradient"``, ``"weakest force"``,
        ``"strongest force"``).
    evaluations
        Number of solved stacks of layers.
    """

    planned: Design
    best: Design
    stiffening: float
    gradient: float
    binding: tuple[str, ...]
    evaluations: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Forces:
    """Range of the forces of a stack, and the limits at its ends."""

    low_n: float
    high_n: float
    low_by: str
    high_by: str

    def at(self, fractions: Floats) -> tuple[float, ...]:
        """Forces at fractions, in [0, 1], of the range's logarithm, the weakest first."""
        forces = self.low_n * (self.high_n / self.low_n) ** np.sort(np.clip(fractions, 0.0, 1.0))
        return tuple(forces.tolist())


def optimise_design(
    planned: Protocol,
    *,
    prior: InclusionPrior,
    calibration: Calibration,
    sensor: Sensor | None = None,
    criterion: str = "all",
    evaluations: int = MOST_EVALUATIONS,
    traced: bool = False,
    degrees: Degrees | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> DesignOptimum:
    """Search the moduli of the layers, as a common factor and a gradient, and the forces of the presses.

    Parameters
    ----------
    planned
        The initial design; numbers of presses and references and the probe's shape are fixed.
    prior, sensor, degrees
        See `information`.
    calibration, traced
        Of the planned probe; see `calibration_for`.
    criterion
        The objective: ``"all"``, the mean over the prior of the log of the product of the three expected standard
        deviations, or the expected error of ``"diameter_mm"``, ``"depth_mm"`` or ``"young_kpa"``.
    evaluations
        Largest number of stacks, in [1, 25].
    progress
        Called with (stacks solved, largest number).

    Raises
    ------
    InputError
        When no force satisfies the limits with any stack.
    UnknownNameError
        When the criterion is unknown.

    Returns
    -------
    Optimum
        The best design and its binding limits.
    """
    require_one_of("criterion", criterion, CRITERIA)
    evaluations = require_integer("evaluations", evaluations, 1, MOST_EVALUATIONS)
    searched = even_inclusions(prior, SEARCHED)
    tried: list[tuple[float, Floats, PlannedView, _Forces]] = []

    def view_at(octaves: Floats) -> PlannedView:
        probe = with_moduli(planned.probe, _moduli(planned.probe, octaves))
        own = calibration_for(probe, of=planned.probe, calibration=calibration, traced=traced)
        return planned_view(replace(planned, probe=probe), prior=prior, calibration=own, sensor=sensor, degrees=degrees)

    def evaluate(octaves: Floats) -> float:
        view = view_at(octaves)
        forces = _forces(view, searched)
        value = HOPELESS
        if forces.low_n < forces.high_n:
            value, view = _pressed_best(view, forces, searched, criterion)
        tried.append((value, octaves.copy(), view, forces))
        if progress is not None:
            progress(len(tried), evaluations)
        return value

    start = np.zeros(2)
    # The first simplex spans an octave: a smaller one wastes evaluations on the scale.
    simplex = np.array([start, [1.0, 0.0], [0.0, 1.0]])
    scipy.optimize.minimize(
        evaluate,
        start,
        method="Nelder-Mead",
        bounds=[(-OCTAVES, OCTAVES)] * 2,
        options={"maxfev": evaluations, "initial_simplex": simplex, "xatol": 0.05, "fatol": 1e-3},
    )
    value, octaves, view, forces = min(tried, key=lambda one: one[0])
    if value == HOPELESS:
        raise InputError(
            f"forces must exist at which the whole face touches within every limit; got none for {len(tried)} stacks "
            "of layers (a flatter face, a shorter exposure or a thicker probe helps)"
        )
    best = design_of(replace(view, protocol=replace(view.protocol, name="best found")))
    return DesignOptimum(
        planned=design_of(view_at(start)),
        best=best,
        stiffening=float(2.0 ** octaves[0]),
        gradient=float(2.0 ** octaves[1]),
        binding=_binding(best, octaves, forces),
        evaluations=len(tried),
    )


def _moduli(probe: Probe, octaves: Floats) -> list[float]:
    """Moduli times a common factor and a gradient from skin to glass, which is 1 in the middle."""
    thickness = np.array([layer.thickness_mm for layer in probe.layers])
    middle = (np.cumsum(thickness) - thickness / 2) / thickness.sum()
    young = np.array([layer.young_kpa for layer in probe.layers])
    return list((young * 2.0 ** (octaves[0] + octaves[1] * (0.5 - middle))).tolist())


def _forces(view: PlannedView, inclusions: Floats) -> _Forces:
    """Range from full contact to the first limit: strain, saturation or the largest force."""
    covering = greatest_covering_force_n(view, inclusions)
    most = {
        "strain": largest_force_n(view.surrogate, probe=view.protocol.probe, prior=view.model.prior),
        "saturation": _clipping_n(view, inclusions),
        "strongest force": LARGEST_FORCE_N,
    }
    high_by = min(most, key=lambda name: most[name])
    weakest = max(WEAKEST * most[high_by], LEAST_FORCE_N)
    low_by = "contact" if covering > weakest else "weakest force"
    return _Forces(low_n=max(covering, weakest), high_n=most[high_by], low_by=low_by, high_by=high_by)


def _clipping_n(view: PlannedView, inclusions: Floats) -> float:
    """Force at which the brightest point of any press saturates."""

    def excess(force_n: float) -> float:
        pressed = at_forces(view, (force_n,) * len(view.protocol.presses))
        brightest = max(float(pressed.grey(None).max()), float(pressed.grey(inclusions).max()))
        return brightest - CLIP_FRACTION * view.sensor.full_scale

    if excess(LARGEST_FORCE_N) < 0:
        return np.inf
    if excess(LEAST_FORCE_N) > 0:
        return 0.0
    return float(scipy.optimize.brentq(excess, LEAST_FORCE_N, LARGEST_FORCE_N, xtol=1e-4))


def at_forces(view: PlannedView, forces_n: tuple[float, ...]) -> PlannedView:
    """The presses at other forces."""
    protocol = view.protocol
    presses = tuple(replace(press, force_n=force) for press, force in zip(protocol.presses, forces_n, strict=True))
    every = [press.force_n for press in presses] + [press.force_n for press in presses if press.with_reference]
    return replace(
        view, protocol=replace(protocol, presses=presses), model=replace(view.model, force_n=np.array(every))
    )


def _pressed_best(view: PlannedView, forces: _Forces, inclusions: Floats, criterion: str) -> tuple[float, PlannedView]:
    """The best forces for one stack, and their score."""

    def value(fractions: Floats) -> float:
        return score(information_of(at_forces(view, forces.at(fractions)), inclusions), criterion)

    count = len(view.protocol.presses)
    start = np.linspace(0.0, 1.0, count + 1)[1:] if count > 1 else np.array([0.8])
    simplex = np.vstack([start, *(start + 0.3 * np.where(start > 0.6, -1, 1) * row for row in np.eye(count))])
    minimum = scipy.optimize.minimize(
        value,
        start,
        method="Nelder-Mead",
        bounds=[(0.0, 1.0)] * count,
        options={"maxfev": FORCE_EVALUATIONS, "initial_simplex": simplex, "xatol": 0.01, "fatol": 1e-3},
    )
    return float(minimum.fun), at_forces(view, forces.at(minimum.x))


def _binding(best: Design, octaves: Floats, forces: _Forces) -> tuple[str, ...]:
    """Names of the binding limits: forces, moduli, then violated limits."""
    span = np.log(forces.high_n / forces.low_n)
    pressed, names = best.protocol.forces_n, []
    if np.log(max(pressed) / forces.low_n) > (1 - AT_END) * span:
        names.append(forces.high_by)
    if np.log(min(pressed) / forces.low_n) < AT_END * span:
        names.append(forces.low_by)
    extent = (1 - AT_END) * OCTAVES
    if abs(octaves[0]) > extent:
        names.append("softest" if octaves[0] < 0 else "stiffest")
    if abs(octaves[1]) > extent:
        names.append("gradient")
    return tuple(dict.fromkeys([*names, *best.limits.broken]))
