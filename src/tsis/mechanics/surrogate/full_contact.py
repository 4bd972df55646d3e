"""All presses that cover a probe's face, as polynomials over a box.

At small strain a press that covers the face is affine in the force: ``shape + force * unit``. The unit is the response
of a flat face; the shape is the self-equilibrated part from a dome's gap. One build serves every force.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from tsis.files.cache import cached_arrays
from tsis.mechanics.small_strain.slab import Resolution
from tsis.mechanics.surrogate.building import CHECKED_FRACTION, largest_error, profiles, solve_all, surrogate_key
from tsis.mechanics.surrogate.polynomial import Box, Degrees, Surrogate
from tsis.mechanics.surrogate.states import FACE_POINTS, PRESS_OUTPUTS, SmallStrainSlabs, full_contact_rows
from tsis.model.press import MN_PER_N
from tsis.model.probe import Probe
from tsis.model.require import require_number, require_type

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.mechanics.mesh import Floats
    from tsis.mechanics.surrogate.building import SurrogatePoint
    from tsis.mechanics.surrogate.states import Slabs


FORMAT_VERSION = 1
FULL_CONTACT_DEGREES = Degrees(diameter=7, depth=6, contrast=2, tissue=3, thickness=3, baseline=4)
# A change by Poisson's ratio is small, so a coarser polynomial is accurate enough.
POISSON_DEGREES = Degrees(diameter=4, depth=3, contrast=2, tissue=2, thickness=1, baseline=3)
LARGEST_POISSON = 0.495


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FullContactProfiles:
    """Surrogates of one part of the presses, with 121, 121 and 1 outputs.

    The values of a unit are per newton, those of a derivative per unit of Poisson's ratio.
    """

    pressure_kpa: Surrogate
    face_displacement_mm: Surrogate
    approach_mm: Surrogate


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FullContactParts:
    """A press is ``shape + force_n * unit``; the shape of a flat face is zero, and None."""

    unit: FullContactProfiles
    shape: FullContactProfiles | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FullContactSurrogate:
    """All presses of one probe whose contact covers its face, over a box.

    Attributes
    ----------
    radius_mm
        Radii of the profiles, evenly spaced from the axis to the edge, shape (121,).
    unit
        Press by one newton.
    shape
        Part from a dome's gap, with zero force; None when the face is flat.
    by_poisson
        Derivatives of both by Poisson's ratio, one value for tissue and inclusion.
    covering_force_n
        Surrogate (1 output) of the force at which the contact covers the face; None when the face is flat.
    error
        Largest error of the pressures of unit (at 1 N) and shape in fresh solves inside the box, as a fraction of the
        mean pressure at 1 N, over the inner 0.8 of the face's radius.
    key
        Hash of its content: probe, box, degrees, step and resolution.
    """

    radius_mm: Floats
    unit: FullContactProfiles
    shape: FullContactProfiles | None
    by_poisson: FullContactParts
    covering_force_n: Surrogate | None
    error: float
    key: str


def build_full_contact_surrogate(
    probe: Probe,
    box: Box | None = None,
    *,
    degrees: Degrees | None = None,
    poisson_step: float = 0.004,
    resolution: Resolution | None = None,
    progress: Callable[[int, int], None] | None = None,
    cached: bool = True,
) -> FullContactSurrogate:
    """Build the surrogate of a probe's presses at every force that covers its face, or load it from the disk cache.

    Parameters
    ----------
    probe, box
        The probe, and the ranges of inclusions and tissues.
    degrees, resolution
        Polynomial degrees, and the mesh density of the model.
    poisson_step
        Step of Poisson's ratio for the derivatives, in [1e-4, 0.1], centred on the box's value or just below 0.495.
    progress
        Called with (slabs solved, slabs in all).
    cached
        Whether to read and write the disk cache; its key is the content of all arguments above.

    Raises
    ------
    InputError
        When a value lies outside its range or an inclusion of the box does not fit into the slab.
    """
    require_type("probe", probe, Probe)
    poisson_step = require_number("poisson_step", poisson_step, 1e-4, 0.1, hint="a difference of Poisson's ratio")
    box, degrees, resolution = box or Box(), degrees or FULL_CONTACT_DEGREES, resolution or Resolution()
    by_poisson = {"poisson_degrees": asdict(POISSON_DEGREES), "poisson_step": poisson_step}
    key = surrogate_key(FORMAT_VERSION, probe, box, degrees, resolution, by_poisson)

    solve = partial(_solve, probe, box, degrees, poisson_step, resolution, progress)
    result = cached_arrays("covered", key, solve) if cached else solve()
    unit, shape, force = _parts(box, result["plain"], result["change"])
    by_unit, by_shape, _ = _parts(box, result["plain_by_poisson"], result["change_by_poisson"])
    return FullContactSurrogate(
        radius_mm=np.linspace(0.0, probe.radius_mm, FACE_POINTS),
        unit=unit,
        shape=shape,
        by_poisson=FullContactParts(unit=by_unit, shape=by_shape),
        covering_force_n=force,
        error=float(result["error"]),
        key=key,
    )


def _solve(
    probe: Probe,
    box: Box,
    degrees: Degrees,
    poisson_step: float,
    resolution: Resolution,
    progress: Callable[[int, int], None] | None,
) -> dict[str, Floats]:
    def slabs_at(poisson: float) -> Callable[[float], Slabs]:
        return partial(SmallStrainSlabs, probe, replace(box, poisson=poisson), resolution, full_contact_rows)

    coarse = _at_most(POISSON_DEGREES, degrees)
    total, solved = _slab_count(degrees) + 2 * _slab_count(coarse), 0

    def solve(poisson: float, counts: Degrees) -> tuple[Floats, Floats]:
        nonlocal solved
        before = solved
        solved += _slab_count(counts)
        return solve_all(box, slabs_at(poisson), counts, progress and (lambda done, _: progress(before + done, total)))

    reference, change = solve(box.poisson, degrees)
    high = min(box.poisson + poisson_step / 2, LARGEST_POISSON)
    low = max(high - poisson_step, 0.0)
    (reference_low, change_low), (reference_high, change_high) = solve(low, coarse), solve(high, coarse)
    return {
        "plain": reference,
        "change": change,
        "plain_by_poisson": (reference_high - reference_low) / (high - low),
        "change_by_poisson": (change_high - change_low) / (high - low),
        "error": np.array(_error(probe, box, slabs_at(box.poisson), reference, change)),
    }


def _slab_count(degrees: Degrees) -> int:
    """Number of meshed slabs with an inclusion."""
    return degrees.diameter * degrees.depth * degrees.thickness


def _at_most(degrees: Degrees, limit: Degrees) -> Degrees:
    most = asdict(limit)
    return Degrees(**{name: min(count, most[name]) for name, count in asdict(degrees).items()})


def _parts(
    box: Box, reference: Floats, change: Floats
) -> tuple[FullContactProfiles, FullContactProfiles | None, Surrogate | None]:
    """Unit, shape and covering force; see `full_contact_rows` for the order of the outputs."""
    unit = _profiles(box, reference, change, 0)
    if reference.shape[-1] == PRESS_OUTPUTS:
        return unit, None, None
    force = Surrogate(box=box, baseline=reference[..., 2 * PRESS_OUTPUTS :], change=change[..., 2 * PRESS_OUTPUTS :])
    return unit, _profiles(box, reference, change, PRESS_OUTPUTS), force


def _profiles(box: Box, reference: Floats, change: Floats, first: int) -> FullContactProfiles:
    pressure, displacement, approach = profiles(box, reference, change, first)
    return FullContactProfiles(pressure_kpa=pressure, face_displacement_mm=displacement, approach_mm=approach)


def _error(probe: Probe, box: Box, slabs: Callable[[float], Slabs], reference: Floats, change: Floats) -> float:
    """Largest error of the pressures, as a fraction of the mean pressure at 1 N."""
    unit, shape, _ = _parts(box, reference, change)
    parts = [(0, unit)] if shape is None else [(0, unit), (PRESS_OUTPUTS, shape)]
    inside = int(CHECKED_FRACTION * (FACE_POINTS - 1)) + 1
    mean_kpa = MN_PER_N / (np.pi * probe.radius_mm**2)

    def error(point: SurrogatePoint, fresh: Floats) -> float:
        errors = [point.evaluate(part.pressure_kpa)[:inside] - fresh[start : start + inside] for start, part in parts]
        return float(np.abs(errors).max() / mean_kpa)

    return largest_error(box, slabs, error)
