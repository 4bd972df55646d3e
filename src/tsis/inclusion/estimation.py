"""Estimate an inclusion's diameter, depth and modulus from presses."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.compiled import one_blas_thread
from tsis.errors import InputError, NotCalibratedError
from tsis.inclusion.checks.images import image_findings, require_forces_as_lit
from tsis.inclusion.checks.position import position_findings
from tsis.inclusion.flags import (
    NEARLY_COVERED,
    PARTIAL_CONTACT,
    REPEATS_DISAGREE,
    UNTRUSTED_FLAGS,
    identifiability,
    layer_findings,
    light_findings,
    misfit_finding,
    posterior_findings,
    presence_caveats,
)
from tsis.inclusion.frames import (
    covering_force_n,
    mean_of_repeats,
    repeats_chance,
    require_valid_forces,
    ring_edges,
    with_gain_of_presses,
)
from tsis.inclusion.posterior.exploration import explore_inclusion
from tsis.inclusion.posterior.forward import TISSUE
from tsis.inclusion.posterior.likelihood import least_sd
from tsis.inclusion.prior import PARAMETERS, InclusionPrior
from tsis.inclusion.reading import FrameReading, PressTables, covered_presses, press_tables, read_frames
from tsis.model.estimate import IMPROBABLE, NOT_TRUSTED, Estimate, probability_bound
from tsis.model.image import TactileImage, as_images, require_frames_of_probe, require_image_series, require_same_probe
from tsis.model.require import require_one_of, require_type

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from tsis.inclusion.posterior.exploration import InclusionPosterior
    from tsis.inclusion.posterior.likelihood import InclusionLikelihood, Profiles
    from tsis.mechanics.surrogate.full_contact import FullContactSurrogate
    from tsis.model.calibration import Calibration, LightMap
    from tsis.model.flag import Finding
    from tsis.model.probe import Probe


ROUNDING = 1e-6  # of the radius
STRAINS = ("finite", "small")
LARGER_FACE = 1.2  # of the radius: a map of light that extends further is of another face


def check_calibration(calibration: Calibration, probe: Probe) -> None:
    """Refuse a missing calibration, one of another probe, or one whose map of the light is of another face."""
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
    if extent > LARGER_FACE * probe.radius_mm:
        raise NotCalibratedError(
            f"light of the calibration must end near the rim of the face at {probe.radius_mm:g} mm; got a map that "
            f"extends to {extent:g} mm: it is of a larger probe, so calibrate the light of this one"
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
    strain: str | None = None,
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
        Reference presses of the same probe on tissue without inclusion nearby; they narrow size and depth. Presses that
        are all repeated equally often, each with the same force, count as their means.
    prior
        Ranges of the inclusion and distributions of the tissue; `InclusionPrior` by default.
    progress
        Called with (solved, all) while the tables of a new probe or prior are built once: seconds at small strain,
        minutes at finite.
    strain
        Mechanics of the model: ``"finite"``, or ``"small"``, which is linear and valid for light presses. By default
        finite, but for frames of which a virtual probe says that it made them at small strain.

    Returns
    -------
    Estimate
        Of ``diameter_mm``, ``depth_mm`` and ``young_kpa``, with flags for what the data do not determine.

    Raises
    ------
    InputError
        When there is no image; an image has no force, scale or contact, the force of another image, or one at which a
        dome touches only in part or small strain is not valid; or much of the face lies outside the picture.
    NotCalibratedError
        When the calibration is missing or of another probe.
    ImageMismatchError
        When the images differ in scale, shape, axis, range of values or probe, or grey and colour files are mixed.
    """
    return analyse(
        images,
        probe=probe,
        calibration=calibration,
        reference=reference,
        prior=prior,
        progress=progress,
        strain=strain,
    ).estimate


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InclusionAnalysis:
    """An estimate, and the likelihood, posterior, prior and relative error of the surrogate that it rests on."""

    estimate: Estimate
    likelihood: InclusionLikelihood
    posterior: InclusionPosterior
    prior: InclusionPrior
    model_error: float


def analyse(
    images: TactileImage | Sequence[TactileImage],
    *,
    probe: Probe,
    calibration: Calibration,
    reference: TactileImage | Sequence[TactileImage] | None,
    prior: InclusionPrior | None,
    progress: Callable[[int, int], None] | None,
    strain: str | None,
) -> InclusionAnalysis:
    """The estimate and what it rests on; parameters and errors as `estimate`."""
    targets, references = as_images("images", images), as_images("reference", reference)
    if not targets:
        raise InputError("images must hold at least one TactileImage; got none")
    check_calibration(calibration, probe)
    prior = InclusionPrior() if prior is None else prior
    require_type("prior", prior, InclusionPrior)
    digests = require_image_series(targets + references)
    require_frames_of_probe(targets + references, probe)
    frames = targets, references
    stated = stated_strain([frame.settings for frame in targets + references])
    strain = stated if strain is None else require_one_of("strain", strain, STRAINS)
    of_one_press = calibration
    targets, references, calibration = mean_of_repeats(targets, references, calibration)
    surrogate = _covered(probe, prior) if progress is None else covered_presses(probe, prior, progress=progress)
    # Before the table of finite strain is built, which takes minutes
    require_valid_forces(targets + references, surrogate, probe=probe, prior=prior, strain=strain)
    for places in frames:
        require_forces_as_lit(places, probe=probe, calibration=calibration)
    if progress is None:
        tables = _tables(probe, prior, strain)
    else:
        tables = press_tables(probe, prior, strain, surrogate=surrogate, progress=progress)
    correction = tables.correction
    with_gain = with_gain_of_presses(references or targets, calibration, surrogate, probe=probe, prior=prior)
    with one_blas_thread():  # threads slow down matrices this small

        def read(frames: list[TactileImage]) -> FrameReading:
            return read_frames(frames, references, tables, probe=probe, calibration=with_gain, prior=prior)

        reading = read(targets)
        image_flags = image_findings(targets, references, probe=probe, calibration=with_gain, uneven=reading.uneven)
        posterior = explore_inclusion(reading.likelihood, prior)
        flagged = [
            *posterior_findings(posterior, prior, reading.data),
            *position_findings(reading.position),
            *image_flags,
            *light_findings(calibration),
            *layer_findings(posterior.layer),
        ]
        chance = _misfit_chance(posterior, reading.data)
        if chance < IMPROBABLE:
            disagree = len(targets) > 1 and all(_fits(read([target]), prior) for target in targets)
            flagged.append(misfit_finding(chance, disagree=disagree))
        repeated = _repeats_chance(*frames, of_one_press, probe, prior)
        if chance >= IMPROBABLE > repeated:
            flagged.append(REPEATS_DISAGREE.finding(chance=probability_bound(repeated)))
    flagged += _contact_findings(targets + references, surrogate, reading.likelihood, posterior, prior)
    causes = UNTRUSTED_FLAGS.intersection(flag for flag, _ in flagged)
    estimated = Estimate(
        samples=dict(zip(PARAMETERS, posterior.samples.T, strict=True)),
        prior_sd=prior.sd,
        cramer_rao_sd=dict(zip(PARAMETERS, least_sd(posterior.information).tolist(), strict=True)),
        presence=posterior.presence,
        log_bayes_factor=posterior.log_bayes_factor,
        identifiability=NOT_TRUSTED if causes else identifiability(posterior, prior),
        prior=str(prior),
        presence_trusted=not presence_caveats(causes),
        trusted=not causes,
        flags=tuple(flag for flag, _ in flagged),
        notes=tuple(note for _, note in flagged),
        provenance=_provenance(probe, calibration, prior, *frames, surrogate.key, digests)
        | {"strain": strain, "finite_strain_table": None if correction is None else correction.key},
    )
    return InclusionAnalysis(
        estimate=estimated,
        likelihood=reading.likelihood,
        posterior=posterior,
        prior=prior,
        model_error=tables.error,
    )


@lru_cache(maxsize=4)  # reading them from disk takes as long as an estimate's search
def _tables(probe: Probe, prior: InclusionPrior, strain: str) -> PressTables:
    return press_tables(probe, prior, strain, surrogate=_covered(probe, prior))


@lru_cache(maxsize=4)
def _covered(probe: Probe, prior: InclusionPrior) -> FullContactSurrogate:
    return covered_presses(probe, prior)


def stated_strain(settings: Iterable[Mapping[str, Any]]) -> str:
    """Strain at which frames with these settings are estimated: small where a virtual probe made all of them so."""
    stated = {one.get("strain", "finite") for one in settings}
    return "small" if stated == {"small"} else "finite"


def _fits(reading: FrameReading, prior: InclusionPrior) -> bool:
    return _misfit_chance(explore_inclusion(reading.likelihood, prior), reading.data) >= IMPROBABLE


def _repeats_chance(
    targets: list[TactileImage],
    references: list[TactileImage],
    calibration: Calibration,
    probe: Probe,
    prior: InclusionPrior,
) -> float:
    """The least chance of the scatter of repeats, on the target or on the tissue, whose places may differ."""
    edges, uneven_sd = ring_edges(probe), float(np.hypot(calibration.site_sd, prior.heterogeneity_sd))
    return min(
        repeats_chance(targets, calibration, edges),
        repeats_chance(references, calibration, edges, tissue_sd=uneven_sd),
    )


def _misfit_chance(posterior: InclusionPosterior, data: Profiles) -> float:
    """Probability of at least this misfit for one sphere in a uniform slab."""
    return float(scipy.stats.chi2.sf(posterior.fit.misfit[0], int(data.usable.sum())))


def _contact_findings(
    frames: list[TactileImage],
    surrogate: FullContactSurrogate,
    likelihood: InclusionLikelihood,
    posterior: InclusionPosterior,
    prior: InclusionPrior,
) -> list[Finding]:
    """Flag a dome that touched only in part on the estimated inclusion, in a slab of the prior's thickness.

    A rim that hardly fails to touch does not matter: the rings end at 0.8 of the radius.
    """
    stiffening = float(np.exp(likelihood.within(posterior.fit.nuisance[0])[TISSUE]))
    needed = covering_force_n(surrogate, prior, posterior.middle, stiffening=stiffening)
    least = min(frame.force_n or 0.0 for frame in frames)
    if least >= NEARLY_COVERED * needed:
        return []
    return [PARTIAL_CONTACT.finding(force_n=least, needed_n=needed)]


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
        "method": "posterior of the radial profile: one sphere near the axis, contact over the face",
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
