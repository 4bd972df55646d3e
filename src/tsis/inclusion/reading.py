"""Ring profiles, position of the inclusion and likelihood of the frames of one target."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from tsis.inclusion.checks.position import InclusionPosition, inclusion_position
from tsis.inclusion.checks.unevenness import FieldHarmonics, heterogeneity_evidence
from tsis.inclusion.flags import OFF_AXIS_MM
from tsis.inclusion.frames import depletion_per_n, ring_edges, ring_light, ring_profiles
from tsis.inclusion.posterior.forward import ForwardModel
from tsis.inclusion.posterior.likelihood import InclusionLikelihood, Profiles
from tsis.inclusion.posterior.rings import ring_correction, ring_correlation, ring_responses
from tsis.inclusion.posterior.uneven_tissue import build_field_table, heterogeneity
from tsis.mechanics.surrogate.correction_building import build_finite_correction
from tsis.mechanics.surrogate.full_contact import build_full_contact_surrogate

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.inclusion.posterior.uneven_tissue import FieldTable
    from tsis.inclusion.prior import Booleans, Floats, InclusionPrior
    from tsis.mechanics.surrogate.finite_correction import FiniteCorrection
    from tsis.mechanics.surrogate.full_contact import FullContactSurrogate
    from tsis.model.calibration import Calibration
    from tsis.model.image import TactileImage
    from tsis.model.probe import Probe


LIKELY = 0.01  # chance of a shift by uneven tissue above which it is none of an inclusion
LIKE_FORCE = 0.1  # largest relative difference of the forces of target and reference that locate the inclusion
POSITION_ERROR = 1.25  # sd over the change's peak, by the square of offset over radius (`benchmarks.off_axis --dome`)
POSITION_REACH = 0.25  # correlation length along the rings


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PressTables:
    """Tables of one probe and prior: presses at small strain, and what finite strain and uneven tissue change.

    ``correction`` is None at small strain, ``field`` for even tissue; ``error`` is that of the model's pressures over
    their mean.
    """

    surrogate: FullContactSurrogate
    correction: FiniteCorrection | None
    field: FieldTable | None
    error: float


def covered_presses(
    probe: Probe, prior: InclusionPrior, *, progress: Callable[[int, int], None] | None = None
) -> FullContactSurrogate:
    """The table at small strain of presses that cover the face; seconds, where it is not in the disk cache."""
    return build_full_contact_surrogate(probe, prior.box(), progress=progress)


def press_tables(
    probe: Probe,
    prior: InclusionPrior,
    strain: str,
    *,
    surrogate: FullContactSurrogate | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> PressTables:
    """Build the tables that an estimate at ``strain`` needs, or load them from the disk cache.

    ``surrogate`` is that of `covered_presses`, where it is there already; ``progress`` is called with (solved, all) of
    each table.
    """
    box = prior.box()
    surrogate = surrogate or covered_presses(probe, prior, progress=progress)
    correction = build_finite_correction(probe, box, progress=progress) if strain == "finite" else None
    of_correction = 0.0 if correction is None else correction.error_in(box)
    return PressTables(
        surrogate=surrogate,
        correction=correction,
        field=build_field_table(probe, prior, progress=progress) if prior.heterogeneity_sd else None,
        error=float(np.hypot(surrogate.error, of_correction)),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrameReading:
    """The likelihood of inclusions, its ring profiles, the position of the inclusion and the tissue's harmonics."""

    likelihood: InclusionLikelihood
    data: Profiles
    position: InclusionPosition | None
    uneven: FieldHarmonics | None


def _position(
    targets: list[TactileImage],
    references: list[TactileImage],
    calibration: Calibration,
    probe: Probe,
    uneven: FieldHarmonics | None,
) -> InclusionPosition | None:
    """Position of the inclusion by the strongest press and the reference of the nearest force."""
    if not references:
        return None
    target = max(targets, key=lambda frame: frame.force_n or 0.0)
    reference = min(references, key=lambda frame: abs((frame.force_n or 0.0) - (target.force_n or 0.0)))
    if abs((reference.force_n or 0.0) / (target.force_n or 1.0) - 1) > LIKE_FORCE:
        return InclusionPosition(x_mm=0.0, y_mm=0.0, sd_mm=np.inf, noise_mm=np.inf)
    if uneven is None:
        return inclusion_position(target, reference, calibration, radius_mm=probe.radius_mm)
    causes = uneven.of_sites(1, [target, reference])
    located = inclusion_position(target, reference, calibration, radius_mm=probe.radius_mm, uneven=causes)
    if located.distance_mm > OFF_AXIS_MM and uneven.shift_chance(target, reference) > LIKELY:
        return replace(located, noise_mm=np.inf, sd_mm=np.inf)  # uneven tissue alone explains it
    return located


def read_frames(
    targets: list[TactileImage],
    references: list[TactileImage],
    tables: PressTables,
    *,
    probe: Probe,
    calibration: Calibration,
    prior: InclusionPrior,
) -> FrameReading:
    """Ring profiles, position and likelihood of the frames of one target."""
    frames, edges = targets + references, ring_edges(probe)
    light = ring_light(frames[0], calibration, edges)
    data = ring_profiles(frames, calibration, edges, light=light.level, model_error=tables.error)
    uneven = _heterogeneity(references or targets, tables.field, probe, calibration, prior, light.level)
    position = _position(targets, references, calibration, probe, uneven)
    offset, spread_sd = _offset(position, prior)
    forces, targeted = np.array([frame.force_n for frame in frames]), np.arange(len(frames)) < len(targets)
    if spread_sd and references:
        farther = float(np.sqrt(offset**2 + spread_sd))
        error = position_error(data.grey, forces, targeted, fraction=farther / probe.radius_mm)
        data = replace(data, position=error)
    model = ForwardModel(
        rings=ring_responses(tables.surrogate, edges, light.level, offset_mm=offset),
        level=light.level,
        shading=light.shading,
        calibration=calibration,
        prior=prior,
        force_n=forces,
        is_reference=~targeted,
        depletion_per_n=depletion_per_n(calibration, probe),
        correlation=ring_correlation(edges, calibration.grain_mm),
        spread_sd=spread_sd,
        heterogeneity=None if uneven is None else uneven.hypotheses,
        correction=None
        if tables.correction is None
        else ring_correction(tables.correction, edges, light.level, offset_mm=offset),
    )
    return FrameReading(likelihood=InclusionLikelihood(model, data), data=data, position=position, uneven=uneven)


def _heterogeneity(
    frames: list[TactileImage],
    table: FieldTable | None,
    probe: Probe,
    calibration: Calibration,
    prior: InclusionPrior,
    level: Floats,
) -> FieldHarmonics | None:
    """Hypotheses on the tissue after the harmonics of the frames of one site; None for even tissue."""
    if table is None:
        return None
    is_domed = probe.face_curvature_mm is not None
    hypotheses = heterogeneity(table, prior, ring_edges(probe), level, is_domed=is_domed)
    before = FieldHarmonics(hypotheses=hypotheses, calibration=calibration, probe=probe)
    return replace(before, hypotheses=hypotheses.informed(heterogeneity_evidence(frames, before)))


def _offset(inclusion: InclusionPosition | None, prior: InclusionPrior) -> tuple[float, float]:
    """Distance of the inclusion from the axis in mm, and the standard deviation of its square.

    Either coordinate is normal before the frames and after them; the limit of a square at zero is neglected.
    """
    aimed = prior.offset_sd_mm**2
    if inclusion is None or not aimed:
        return 0.0, 2 * aimed
    seen = aimed / (aimed + inclusion.sd_mm**2)
    square, variance = (seen * inclusion.distance_mm) ** 2, (1 - seen) * aimed
    return float(np.sqrt(square)), float(2 * np.sqrt(variance * (square + variance)))


def position_error(grey: Floats, force_n: Floats, targeted: Booleans, *, fraction: float) -> Floats:
    """Covariance of ring means by the error of the approximation for an inclusion off the axis.

    The error of a target grows with the square of the offset, is a share of the peak of the change, and is smooth along
    the radius: its size is that of kernels of finite elements under a dome, and under a flat face, where the move errs
    less, too large. Half of its variance is common to all targets: the part of a dome's shape errs otherwise than that
    of the force.

    Parameters
    ----------
    grey
        Ring means, shape (frames, rings).
    force_n
        Shape (frames,).
    targeted
        Which frames are of the target, shape (frames,); the others are references.
    fraction
        Offset over the face's radius, in [0, 0.5].

    Returns
    -------
    Shape (frames * rings, frames * rings).
    """
    frames, rings = grey.shape
    peak = np.zeros(frames)
    for k in np.flatnonzero(targeted):
        nearest = min(np.flatnonzero(~targeted), key=lambda other: abs(force_n[other] - force_n[k]))
        peak[k] = np.abs(grey[k] - grey[nearest]).max()
    sd = np.repeat(POSITION_ERROR * fraction**2 * peak, rings)
    middle = (np.arange(rings) + 0.5) / rings
    smooth = np.exp(-0.5 * ((middle[:, None] - middle) / POSITION_REACH) ** 2)
    return np.asarray(np.outer(sd, sd) * np.kron((np.ones((frames, frames)) + np.eye(frames)) / 2, smooth))
