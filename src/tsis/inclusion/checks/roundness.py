"""Roundness of the change by an inclusion: one sphere in a uniform slab has no second harmonic around the axis."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.inclusion.checks.sectors import harmonic, harmonic_noise, shading_harmonics, unevenness
from tsis.inclusion.flags import FEWEST_RINGS, NOT_ROUND, ROUNDNESS_NOT_CHECKED, TILTED
from tsis.model.estimate import IMPROBABLE, probability_bound

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.inclusion.checks.sectors import Sectors, Unevenness
    from tsis.inclusion.prior import Booleans, Complexes, Floats
    from tsis.model.calibration import Calibration
    from tsis.model.flag import Finding


FIRST_RING = 1  # the innermost is a few pixels wide and has no second harmonic
OFFSET_MM = 1.5  # standard deviation of the position of an inclusion near the axis


def roundness(
    target: Sectors, reference: Sectors | None, calibration: Calibration, *, allowed: Sequence[Complexes] = ()
) -> Unevenness | None:
    """Test the second harmonic of the change between reference and target against noise.

    A round signal off the axis by ``d`` has the first harmonic ``-d g'`` and the second ``d²/4 (g'' - g'/r)``, which is
    ``-d/4 (h' - h/r)`` of the first, h. This is allowed for inclusions within some `OFFSET_MM` of the axis.

    Parameters
    ----------
    target, reference
        The frames in rings and sectors; without a reference the target alone is tested.
    calibration
        The errors.
    allowed
        Second harmonics of all rings by other causes, each with a standard normal factor.

    Returns
    -------
    The result, or None when too few rings are complete.
    """
    frames = [target] if reference is None else [target, reference]
    use = _tested_rings(frames)
    if use is None:
        return None
    change = target.grey if reference is None else target.grey - reference.grey
    radius, first = target.grid.ring_radius_mm[use], harmonic(change, 1)[use]
    off_axis = [OFFSET_MM / 4 * part for part in (np.gradient(first, radius), first / radius)]
    existing = [rotated * part for part in off_axis for rotated in (1, 1j)]
    existing += shading_harmonics(
        target.grey.mean(axis=1)[use],
        harmonic(target.grid.growth_per_mm, 2)[use],
        harmonic(target.grid.flux, 2)[use],
        radius,
    )
    existing += [cause[use] for cause in allowed]
    variance = harmonic_variance(change, frames, calibration, order=2)[:, use]
    return unevenness(harmonic(change, 2)[use], variance, radius, given=existing)


def shift_chance(
    target: Sectors, reference: Sectors, calibration: Calibration, *, allowed: Sequence[Complexes]
) -> float:
    """Probability of the first harmonic of the change between reference and target without an inclusion off the axis.

    ``allowed`` are first harmonics of all rings by other causes, each with a standard normal factor. 1 when too few
    rings are complete.
    """
    use = _tested_rings([target, reference])
    if use is None:
        return 1.0
    grid, change = target.grid, target.grey - reference.grey
    growth, flux = harmonic(grid.growth_per_mm, 1)[use], harmonic(grid.flux, 1)[use]
    existing = shading_harmonics(target.grey.mean(axis=1)[use], growth, flux, grid.ring_radius_mm[use])
    existing += [cause[use] for cause in allowed]
    variance = harmonic_variance(change, [target, reference], calibration, order=1)[:, use]
    return unevenness(harmonic(change, 1)[use], variance, grid.ring_radius_mm[use], given=existing).chance


def harmonic_variance(grey: Floats, frames: Sequence[Sectors], calibration: Calibration, *, order: int) -> Floats:
    """Variances of both parts of a harmonic of ``grey``, a frame or the difference of two, shape (2, rings).

    A pattern of uniform variance around a ring gives a harmonic's parts twice the variance of the ring's mean. The
    fixed pattern and the error of the light scale with ``grey``; pixel noise and repeatability add up over the frames.
    """
    fixed = calibration.pattern_sd**2 + frames[0].grid.light_sd ** 2
    pattern = fixed * grey.mean(axis=1) ** 2
    for frame in frames:
        pattern = pattern + (calibration.repeatability_sd * frame.grey.mean(axis=1)) ** 2
    pixels = np.sum([frame.variance for frame in frames], axis=0)
    return np.asarray(2 * pattern + harmonic_noise(pixels, order))


def _tested_rings(frames: Sequence[Sectors]) -> Booleans | None:
    """Mask of the rings of a test, or None when too few are complete."""
    use = np.logical_and.reduce([frame.usable for frame in frames])
    use[:FIRST_RING] = False
    return use if use.sum() >= FEWEST_RINGS else None


def _least_likely(tests: Sequence[Unevenness | None]) -> tuple[int, Unevenness | None]:
    """Number of results, and the least likely one where it is improbable among so many."""
    done = [result for result in tests if result is not None]
    worst = min(done, key=lambda result: (result.chance, -result.over_noise), default=None)
    return len(done), None if worst is None or worst.chance >= IMPROBABLE / len(done) else worst


def roundness_findings(
    targets: Sequence[Sectors],
    references: Sequence[Sectors | None],
    calibration: Calibration,
    allowed: Sequence[Sequence[Complexes]] | None = None,
) -> list[Finding]:
    """Flag ``not_one_round_inclusion`` for the least round target, or ``roundness_not_checked``.

    A target is compared with its reference, or tested alone where that is None; ``allowed`` as for `roundness`.
    """
    tests = [
        roundness(target, reference, calibration, allowed=causes)
        for target, reference, causes in zip(targets, references, allowed or [()] * len(targets), strict=True)
    ]
    count, worst = _least_likely(tests)
    if count == 0:
        return [ROUNDNESS_NOT_CHECKED.finding()]
    if worst is None:
        return []
    return [
        NOT_ROUND.finding(
            radius_mm=worst.radius_mm,
            size=worst.size_grey,
            over_noise=worst.over_noise,
            chance=probability_bound(worst.chance),
        )
    ]


AXIS_MM = 0.1  # standard deviation of the axis in the picture


def tilt_evidence(
    sectors: Sectors, calibration: Calibration, *, allowed: Sequence[Complexes] = ()
) -> Unevenness | None:
    """Test the first harmonic of a reference press against noise; None when too few rings are complete.

    A small error of the axis, which shifts the picture over the light, does not count as tilt; ``allowed`` are first
    harmonics of all rings by other causes, each with a standard normal factor.
    """
    use = _tested_rings([sectors])
    if use is None:
        return None
    grid, grey = sectors.grid, sectors.grey.mean(axis=1)
    radius = grid.ring_radius_mm
    lit = grid.light.sum(axis=1) / np.maximum(grid.count.sum(axis=1), 1)
    shifted = AXIS_MM * (np.gradient((grey * lit)[use], radius[use]) / lit[use]).astype(complex)
    growth, flux = harmonic(grid.growth_per_mm, 1)[use], harmonic(grid.flux, 1)[use]
    existing = [shifted, 1j * shifted, *shading_harmonics(grey[use], growth, flux, radius[use])]
    existing += [cause[use] for cause in allowed]
    variance = harmonic_variance(sectors.grey, [sectors], calibration, order=1)[:, use]
    return unevenness(harmonic(sectors.grey, 1)[use], variance, radius[use], given=existing)


def tilt_findings(
    references: Sequence[Sectors], calibration: Calibration, allowed: Sequence[Sequence[Complexes]] | None = None
) -> list[Finding]:
    """Flag ``tilted`` for the reference press of the largest tilt; ``allowed`` as for `tilt_evidence`."""
    tests = zip(references, allowed or [()] * len(references), strict=True)
    _, worst = _least_likely([tilt_evidence(harmonics, calibration, allowed=causes) for harmonics, causes in tests])
    if worst is None:
        return []
    return [TILTED.finding(radius_mm=worst.radius_mm, excess=2 * worst.size_grey, over_noise=worst.over_noise)]
