"""Estimate an inclusion's diameter, depth and modulus from presses."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from threadpoolctl import threadpool_limits

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.errors import InputError, NotCalibratedError
from tsis.inclusion._frames import (
    covering_force_n,
    depletion_per_n,
    require_valid_forces,
    ring_edges,
    ring_light,
    ring_profiles,
    with_gain_of_presses,
)
from tsis.inclusion._prior import PARAMETERS, InclusionPrior
from tsis.inclusion._verdict import (
    OFF_AXIS_MM,
    UNTRUSTED_FLAGS,
    cramer_rao_sd,
    findings,
    identifiability,
    light_findings,
    misfit_chance,
    misfit_finding,
    position_findings,
    presence_caveats,
)
from tsis.inclusion.checks import (
    FieldHarmonics,
    InclusionPosition,
    heterogeneity_evidence,
    image_findings,
    inclusion_position,
)
from tsis.inclusion.posterior import (
    TISSUE,
    ForwardModel,
    InclusionLikelihood,
    Profiles,
    build_field_table,
    explore_inclusion,
    heterogeneity,
    ring_correlation,
    ring_responses,
)
from tsis.mechanics.surrogate import build_full_contact_surrogate
from tsis.model import (
    IMPROBABLE,
    NOT_TRUSTED,
    Calibration,
    Estimate,
    Probe,
    TactileImage,
    as_images,
    require_image_series,
    require_same_probe,
    require_type,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from tsis.inclusion._prior import Floats
    from tsis.inclusion.posterior import FieldTable, InclusionPosterior
    from tsis.mechanics.surrogate import Box, FullContactSurrogate
    from tsis.model import LightMap


ROUNDING = 1e-6  # of the radius


def check_calibration(calibration: Calibration, probe: Probe) -> None:
    """Refuse a missing calibration, one of another probe, or one whose map of the light ends inside the face."""
    require_same_probe(probe, calibration)
    light = calibration.light
    if light is None or _is_uniform(light):
        return
    extent = min(-light.x_mm[0], light.x_mm[-1], -light.y_mm[0], light.y_mm[-1])
    if extent < (1 - ROUNDING) * probe.radius_mm:
        raise NotCalibratedError(
            f"light of the calibration must extend to the rim of the face at {probe.radius_mm:g} mm; got a map that "
            f"ends at {extent:g} mm: it is of a smaller probe, so calibrate the light of this one"
        )


def _is_uniform(light: LightMap) -> bool:
    """Uniform, and therefore valid beyond its ends."""
    fields = (light.relative, light.flux_x, light.flux_y, light.growth_per_mm, light.bend_per_mm2)
    return all(np.ptp(field) == 0 for field in fields)


def estimate(
    images: TactileImage | Sequence[TactileImage],
    *,
    probe: Probe,
    calibration: Calibration,
    reference: TactileImage | Sequence[TactileImage] | None = None,
    prior: InclusionPrior | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Estimate:
    """Estimate an inclusion under the probe's axis, with calibrated intervals.

    The posterior over diameter, depth and modulus follows from the ring means of the grey level. Gain, offset and
    force of each frame, the moduli of tissue and probe, Poisson's ratio, the slab's thickness, the light's shading and
    the inclusion's position are nuisances, integrated out within their stated errors.

    Parameters
    ----------
    images
        One or more raw presses on one target, each with ``force_n`` and ``mm_per_pixel``.
    probe
        The probe that pressed.
    calibration
        Response of grey level to pressure, and the errors.
    reference
        Reference presses of the same probe on tissue without inclusion nearby; they narrow size and depth.
    prior
        Ranges of the inclusion and distributions of the tissue; `InclusionPrior` by default.
    progress
        Called with (slabs solved, all slabs) while the surrogate of a new probe or prior is built once, in seconds.

    Returns
    -------
    Estimate
        Of ``diameter_mm``, ``depth_mm`` and ``young_kpa``, with flags for what the data do not determine.

    Raises
    ------
    InputError
        When there is no image; an image has no force, scale or contact, or a force at which a dome touches only in part
        or small strain is not valid; or much of the face lies outside the picture.
    NotCalibratedError
        When the calibration is missing or of another probe.
    ImageMismatchError
        When the images differ in scale, shape, axis or range of values.
    """
    targets, references = as_images("images", images), as_images("reference", reference)
    if not targets:
        raise InputError("images must hold at least one TactileImage; got none")
    check_calibration(calibration, probe)
    prior = InclusionPrior() if prior is None else prior
    require_type("prior", prior, InclusionPrior)
    digests = require_image_series(targets + references)
    box = prior.box()
    surrogate = (
        _surrogate(probe, box) if progress is None else build_full_contact_surrogate(probe, box, progress=progress)
    )
    require_valid_forces(targets + references, surrogate, probe=probe, prior=prior)
    response = with_gain_of_presses(references or targets, calibration, surrogate, probe=probe, prior=prior)
    with threadpool_limits(limits=1, user_api="blas"):  # threads slow down matrices this small

        def read(frames: list[TactileImage]) -> FrameReading:
            return read_frames(frames, references, surrogate, probe=probe, calibration=response, prior=prior)

        reading = read(targets)
        of_images = image_findings(targets, references, probe=probe, calibration=response, uneven=reading.uneven)
        result = explore_inclusion(reading.likelihood, prior)
        flagged = [*findings(result, prior, reading.data), *position_findings(reading.position), *of_images]
        flagged += light_findings(calibration)
        chance = misfit_chance(result, reading.data)
        if chance < IMPROBABLE:
            disagree = len(targets) > 1 and all(_fits(read([target]), prior) for target in targets)
            flagged.append(misfit_finding(chance, disagree=disagree))
    flagged += _contact_findings(targets + references, surrogate, reading.likelihood, result, prior)
    causes = UNTRUSTED_FLAGS.intersection(flag for flag, _ in flagged)
    return Estimate(
        samples=dict(zip(PARAMETERS, result.samples.T, strict=True)),
        prior_sd=prior.sd,
        cramer_rao_sd=cramer_rao_sd(result),
        presence=result.presence,
        log_bayes_factor=result.log_bayes_factor,
        identifiability=NOT_TRUSTED if causes else identifiability(result, prior),
        prior=str(prior),
        presence_trusted=not presence_caveats(causes),
        trusted=not causes,
        flags=tuple(flag for flag, _ in flagged),
        notes=tuple(note for _, note in flagged),
        provenance=_provenance(probe, calibration, prior, targets, references, surrogate.key, digests),
    )


LIKELY = 0.01  # chance of a shift by uneven tissue above which it is none of an inclusion
LIKE_FORCE = 0.1  # largest relative difference of the forces of target and reference that locate the inclusion


@lru_cache(maxsize=4)  # reading it from disk takes as long as an estimate's search
def _surrogate(probe: Probe, box: Box) -> FullContactSurrogate:
    return build_full_contact_surrogate(probe, box)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrameReading:
    """The likelihood of inclusions, its ring profiles, the position of the inclusion and the tissue's harmonics."""

    likelihood: InclusionLikelihood
    data: Profiles
    position: InclusionPosition | None
    uneven: FieldHarmonics | None


def _fits(reading: FrameReading, prior: InclusionPrior) -> bool:
    return misfit_chance(explore_inclusion(reading.likelihood, prior), reading.data) >= IMPROBABLE


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
    found = inclusion_position(target, reference, calibration, radius_mm=probe.radius_mm, uneven=causes)
    if found.distance_mm > OFF_AXIS_MM and uneven.shift_chance(target, reference) > LIKELY:
        return replace(found, noise_mm=np.inf, sd_mm=np.inf)  # uneven tissue alone explains it
    return found


def _contact_findings(
    frames: list[TactileImage],
    surrogate: FullContactSurrogate,
    likelihood: InclusionLikelihood,
    posterior: InclusionPosterior,
    prior: InclusionPrior,
) -> list[tuple[str, str]]:
    """Flag a dome that touched only in part on the estimated inclusion, in a slab of the prior's thickness."""
    stiffening = float(np.exp(likelihood.within(posterior.fit.nuisance[0])[TISSUE]))
    needed = covering_force_n(surrogate, prior, posterior.middle, stiffening=stiffening)
    least = min(frame.force_n or 0.0 for frame in frames)
    if least >= needed:
        return []
    return [
        (
            "contact_not_whole",
            f"At {least:g} N the dome touches the estimated inclusion only in part; the model assumes full contact, "
            f"from {needed:.2g} N on: press harder.",
        )
    ]


def read_frames(
    targets: list[TactileImage],
    references: list[TactileImage],
    surrogate: FullContactSurrogate,
    *,
    probe: Probe,
    calibration: Calibration,
    prior: InclusionPrior,
) -> FrameReading:
    """Ring profiles, position and likelihood of the frames of one target."""
    frames, edges = targets + references, ring_edges(probe)
    light = ring_light(frames[0], calibration, edges)
    data = ring_profiles(frames, calibration, edges, light=light.level, model_error=surrogate.error)
    uneven = _heterogeneity(references or targets, probe, calibration, prior, light.level)
    position = _position(targets, references, calibration, probe, uneven)
    offset, spread_sd = _offset(position, prior)
    model = ForwardModel(
        rings=ring_responses(surrogate, edges, light.level, offset_mm=offset),
        level=light.level,
        shading=light.shading,
        calibration=calibration,
        prior=prior,
        force_n=np.array([frame.force_n for frame in frames]),
        is_reference=np.array([False] * len(targets) + [True] * len(references)),
        depletion_per_n=depletion_per_n(calibration, probe),
        correlation=ring_correlation(edges, calibration.grain_mm),
        spread_sd=spread_sd,
        heterogeneity=None if uneven is None else uneven.hypotheses,
    )
    return FrameReading(likelihood=InclusionLikelihood(model, data), data=data, position=position, uneven=uneven)


@lru_cache(maxsize=4)
def _field_table(probe: Probe, prior: InclusionPrior) -> FieldTable:
    return build_field_table(probe, prior)


def _heterogeneity(
    frames: list[TactileImage], probe: Probe, calibration: Calibration, prior: InclusionPrior, level: Floats
) -> FieldHarmonics | None:
    """Hypotheses on the tissue after the harmonics of the frames of one site; None for even tissue."""
    if prior.heterogeneity_sd == 0:
        return None
    is_domed = probe.face_curvature_mm is not None
    hypotheses = heterogeneity(_field_table(probe, prior), prior, ring_edges(probe), level, is_domed=is_domed)
    before = FieldHarmonics(hypotheses=hypotheses, calibration=calibration, probe=probe)
    return replace(before, hypotheses=hypotheses.informed(heterogeneity_evidence(frames, before)))


def _offset(inclusion: InclusionPosition | None, prior: InclusionPrior) -> tuple[float, float]:
    """Distance of the inclusion from the axis in mm, and the standard deviation of its square in mm**2."""
    if inclusion is None or inclusion.sd_mm > prior.offset_sd_mm:
        # An examiner aims at the axis; the limit of a square at zero is neglected.
        return 0.0, 2 * prior.offset_sd_mm**2
    # Noise adds twice the variance of a coordinate to the squared distance.
    square = max(inclusion.distance_mm**2 - 2 * inclusion.sd_mm**2, 0.0)
    return float(np.sqrt(square)), float(2 * inclusion.sd_mm * np.sqrt(square + inclusion.sd_mm**2))


def _provenance(
    probe: Probe,
    calibration: Calibration,
    prior: InclusionPrior,
    targets: list[TactileImage],
    references: list[TactileImage],
    surrogate_key: str,
    digests: list[str],
) -> dict[str, Any]:
    return {
        "notice": RESEARCH_USE_ONLY,
        "tsis": __version__,
        "method": "posterior of the radial profile: small strain, one sphere near the axis, contact over the face",
        "probe": asdict(probe),
        "calibration": calibration.provenance(),
        "prior": asdict(prior),
        "surrogate": surrogate_key,
        "images": [_describe(*pair) for pair in zip(targets, digests, strict=False)],
        "reference": [_describe(*pair) for pair in zip(references, digests[len(targets) :], strict=True)],
    }


def _describe(image: TactileImage, digest: str) -> dict[str, Any]:
    return {
        "name": image.name,
        "sha256": digest,
        "shape": list(image.grey.shape),
        "mm_per_pixel": list(image.scale()),
        "force_n": image.force_n,
        "settings": dict(image.settings),
    }
