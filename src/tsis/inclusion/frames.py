"""Ring profiles of camera frames, and the binary image (6.11)."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from tsis.errors import InputError
from tsis.imaging import Features, features
from tsis.imaging.profile import radial_profile
from tsis.inclusion.posterior.forward import ForwardModel
from tsis.inclusion.posterior.likelihood import Profiles
from tsis.inclusion.posterior.rings import RingShading, ShadingUncertainty, ring_responses
from tsis.mechanics.small_strain.linear_press import STRAIN_LIMIT, nominal_strain
from tsis.mechanics.surrogate.finite_correction import correction_box
from tsis.model.calibration import (
    BEND_TERMS,
    FLUX_TERMS,
    GROWTH_TERMS,
    LIGHT_REACH,
    LIGHT_RINGS,
    LIGHT_TERMS,
    LightTerms,
)
from tsis.model.image import TactileImage
from tsis.model.press import MN_PER_N
from tsis.model.require import require_number

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from tsis.inclusion.prior import Floats, InclusionPrior
    from tsis.mechanics.surrogate.full_contact import FullContactSurrogate
    from tsis.mechanics.surrogate.polynomial import Surrogate
    from tsis.model.calibration import Calibration, LightMap
    from tsis.model.probe import Probe


RINGS = LIGHT_RINGS
DARKEST = 1e-3  # of the brightest light; darker pixels are not corrected
GENERIC_GROWTH_PER_MM, GENERIC_FLUX = 0.25, 0.5  # of lamps around a soft probe; the flux is that at the rim
# Standard deviations where no dent was measured: growth per mm and flux at the rim of each Legendre term, light lost
# per newton, saturation of the contact per kPa**2, log gain, because the force step's tips dent the face as well, and
# the least error of a force, which acts as an unknown loss of light in each frame
GENERIC_GROWTH_SD, GENERIC_FLUX_SD = 0.25, 0.75
GENERIC_LOSS_SD, GENERIC_SQUARE_SD, GENERIC_GAIN_SD, GENERIC_FORCE_SD = 0.02, 1.5e-3, 0.5, 0.01
GAIN_RANGE = (1e-6, 1e6)  # of a `Calibration`
OUTER_FRACTION = LIGHT_REACH  # of the face's radius; beyond it the singular pressure at the rim dominates


def ring_edges(probe: Probe) -> Floats:
    """Boundaries of the profile's rings, mm."""
    return np.linspace(0.0, OUTER_FRACTION * probe.radius_mm, RINGS + 1)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RingLight:
    """Light of each ring, shape (rings,), and its shading by a dent."""

    level: Floats
    shading: RingShading


def ring_light(frame: TactileImage, calibration: Calibration, edges_mm: Floats) -> RingLight:
    """Means over the pixels of each ring; without a light map, uniform light with the shading of usual lamps."""
    if calibration.light is None:
        return _usual_light(len(edges_mm) - 1)
    return _rings_of(calibration.light, frame.grey.shape, frame.scale(), frame.axis(), tuple(edges_mm.tolist()))


def _usual_light(rings: int) -> RingLight:
    """Light that was corrected to be uniform, under lamps whose change by a dent was not measured."""
    at_rim = OUTER_FRACTION  # the terms of the flux are over the last ring's distance
    first = GROWTH_TERMS + BEND_TERMS
    mean = np.zeros(LIGHT_TERMS)
    mean[0], mean[first] = GENERIC_GROWTH_PER_MM, at_rim * GENERIC_FLUX
    usual = LightTerms.of(mean, rings)
    growth_sd, flux_sd = (
        sd * np.minimum(1.0, 3.0 / np.arange(1, terms + 1)) ** 2  # lamps vary smoothly along the radius
        for sd, terms in ((GENERIC_GROWTH_SD, GROWTH_TERMS), (at_rim * GENERIC_FLUX_SD, FLUX_TERMS))
    )
    none = np.zeros(BEND_TERMS)
    sd = np.diag([*growth_sd, *none, *flux_sd, GENERIC_LOSS_SD, GENERIC_SQUARE_SD, 0.0])
    uncertainty = ShadingUncertainty.of_terms(sd[:, sd.any(axis=0)], rings)
    shading = RingShading(
        growth_per_mm=usual.growth_per_mm, bend_per_mm2=np.zeros(rings), flux=usual.flux, uncertainty=uncertainty
    )
    return RingLight(level=np.ones(rings), shading=shading)


def with_gain_of_presses(
    frames: list[TactileImage],
    calibration: Calibration,
    surrogate: FullContactSurrogate,
    *,
    probe: Probe,
    prior: InclusionPrior,
) -> Calibration:
    """Where no light map was measured, the calibration with the gain of these presses, whose forces are known.

    The tips of the force step dent the face deeply, and the light of their dents changes its gain by a factor.
    """
    if calibration.light is not None:
        return calibration
    edges = ring_edges(probe)
    light = ring_light(frames[0], calibration, edges)
    data = ring_profiles(frames, calibration, edges, light=light.level, model_error=0.0)
    model = ForwardModel(
        rings=ring_responses(surrogate, edges, light.level),
        level=light.level,
        shading=light.shading,
        calibration=calibration,
        prior=prior,
        force_n=np.array([frame.force_n for frame in frames]),
        is_reference=np.ones(len(frames), dtype=bool),
    )
    expected = model.grey(None, np.zeros(len(model.nuisance_sd(np.ones(len(frames))))))[0]
    area = data.usable * np.diff(edges**2)
    ratio = float((area * data.grey).sum() / (area * expected).sum())
    gain = float(np.clip(ratio * calibration.gain_grey_per_kpa, *GAIN_RANGE))
    return replace(
        calibration,
        gain_grey_per_kpa=gain,
        gain_sd=max(calibration.gain_sd, GENERIC_GAIN_SD),
        force_sd=max(calibration.force_sd, GENERIC_FORCE_SD),
    )


@lru_cache(maxsize=8)  # equal for all frames of a camera
def _rings_of(
    light: LightMap,
    shape: tuple[int, int],
    scale: tuple[float, float],
    axis: tuple[float, float],
    edges_mm: tuple[float, ...],
) -> RingLight:
    frame = TactileImage(grey=np.zeros(shape), mm_per_pixel=scale, axis_px=axis, full_scale=65535.0)
    x, y = pixels_mm(frame)
    relative, flux_x, flux_y, growth, bend = light.undented(x, y)
    outwards = relative * (flux_x * x + flux_y * y[:, None]) / np.maximum(np.hypot(x, y[:, None]), 1e-9)

    def mean(values: NDArray[np.floating[Any]], empty: float) -> Floats:
        means = radial_profile(replace(frame, grey=np.asarray(values, dtype=float)), edges_mm=edges_mm).mean_grey
        return np.asarray(np.nan_to_num(means, nan=empty))

    level = mean(relative, 1.0)
    if level.min() <= DARKEST * level.max():
        raise InputError("light of the calibration must reach all rings of the face; got a dark ring")
    grows, bends, flux = (mean(part, 0.0) / level for part in (relative * growth, relative * bend, outwards))
    shading = RingShading(growth_per_mm=grows, bend_per_mm2=bends, flux=flux)
    if light.factor.size:
        shading = replace(shading, uncertainty=ShadingUncertainty.of_terms(light.factor, len(level)))
    return RingLight(level=level, shading=shading)


def depletion_per_n(calibration: Calibration, probe: Probe) -> float:
    """Increase of the light's divisor per newton, for contact in proportion to pressure."""
    if calibration.light is None:
        return 0.0
    fraction = MN_PER_N / (np.pi * probe.radius_mm**2 * calibration.saturation_kpa)
    return calibration.light.depletion * float(fraction)


def pixels_mm(frame: TactileImage) -> tuple[Floats, Floats]:
    """Coordinates of the columns and of the rows from the probe's axis, mm."""
    (rows, columns), axis, (sx, sy) = frame.grey.shape, frame.axis(), frame.scale()
    return np.asarray((np.arange(columns) - axis[0]) * sx), np.asarray((np.arange(rows) - axis[1]) * sy)


def correct_light(frame: TactileImage, calibration: Calibration) -> TactileImage:
    """The frame above its background, corrected to uniform light; it no longer shows which pixels clipped."""
    if calibration.light is None:
        return frame
    light = calibration.light.at(*pixels_mm(frame))
    floor = DARKEST * float(light.max())
    return replace(frame, grey=(frame.grey - calibration.background_grey) / np.maximum(light, floor))


def ring_profiles(
    frames: list[TactileImage], calibration: Calibration, edges_mm: Floats, *, light: Floats, model_error: float
) -> Profiles:
    """Mean grey above background at uniform light of each ring and frame, its variance, and the usable rings.

    A ring's sum of grey over its sum of ``light`` is, with photon noise, the best mean of a round press. The relative
    error of the surrogate counts as noise of each ring, so that a coarse surrogate widens the intervals.
    """
    rings = [radial_profile(frame, edges_mm=edges_mm) for frame in frames]
    count = np.array([ring.count for ring in rings])
    clipped = np.array([ring.clipped_count for ring in rings])
    usable = (count > 0) & (clipped == 0)
    if not usable[:, : RINGS // 2].any(axis=1).all():
        raise InputError(
            "the inner half of the probe's face must lie in every picture without clipping; got one with no "
            "usable ring there (check mm_per_pixel, axis_px and the exposure)"
        )
    above = np.nan_to_num(np.array([ring.mean_grey for ring in rings])) - calibration.background_grey
    pixel = calibration.read_noise_grey**2 + calibration.shot_noise_grey * np.maximum(above, 0.0) + 1 / 12
    grey = above / light
    variance = pixel / (np.maximum(count, 1) * light**2) + (model_error * grey) ** 2
    return Profiles(grey=grey, variance=variance, usable=usable)


def require_valid_forces(
    frames: Sequence[TactileImage],
    surrogate: FullContactSurrogate,
    *,
    probe: Probe,
    prior: InclusionPrior,
    strain: str = "small",
) -> None:
    """Refuse forces without full contact on the prior's tissue without inclusion, or beyond the model's strain.

    The table of finite strain is not needed: its range is known before it is built.
    """
    least = covering_force_n(surrogate, prior, None)
    if strain == "small":
        most, end = largest_force_n(surrogate, probe=probe, prior=prior), f"a nominal strain of {STRAIN_LIMIT:g}"
    else:
        unit_n = least or prior.tissue_young_kpa * probe.radius_mm**2 / MN_PER_N
        most = unit_n * float(correction_box(probe, prior.box()).largest_load(np.array(prior.tissue_young_kpa)))
        end = "the end of the probe's table of finite strain"
    if least > most:
        raise InputError(
            f"no force is valid for this probe on tissue of {prior.tissue_young_kpa:g} kPa: its whole dome touches "
            f"from {_up(least):g} N, and small strain ends at {_down(most):g} N: use a flatter dome or stiffer tissue"
        )
    for frame in frames:
        force = frame.force_n or 0.0
        if not least <= force <= most:
            whole = f"from {_up(least):g} N, at which the whole dome touches, " if least > 0 else ""
            raise InputError(
                f"force_n must be {whole}up to {_down(most):g} N, {end}, on tissue of "
                f"{prior.tissue_young_kpa:g} kPa; got {force:g} N for {frame.name or 'an image'!r}: press at a force "
                "in between, or state the modulus of this tissue in the prior"
            )


def _up(force_n: float) -> float:
    """Two digits, rounded to the valid side."""
    digit = 10 ** (np.floor(np.log10(force_n)) - 1)
    return float(np.format_float_positional(np.ceil(force_n / digit) * digit, precision=6))


def _down(force_n: float) -> float:
    digit = 10 ** (np.floor(np.log10(force_n)) - 1)
    return float(np.format_float_positional(np.floor(force_n / digit) * digit, precision=6))


def covering_force_n(
    surrogate: FullContactSurrogate, prior: InclusionPrior, inclusion: Floats | None, *, stiffening: float = 1.0
) -> float:
    """Least force in newtons at which the contact covers the face; 0 for a flat face.

    ``inclusion`` is diameter, depth and modulus; ``stiffening`` is the tissue's modulus over the prior's.
    """
    if surrogate.covering_force_n is None:
        return 0.0
    at = surrogate.covering_force_n.at_tissue(prior.tissue_young_kpa * stiffening, prior.thickness_mm)
    forces = at.baseline if inclusion is None else at(*inclusion[:, None])[0]
    return float(forces[0])


def largest_force_n(surrogate: FullContactSurrogate, *, probe: Probe, prior: InclusionPrior) -> float:
    """Force at the limit of the nominal strain without inclusion; not positive where the shape exceeds it."""
    at_zero, per_newton = nominal_strains(surrogate, probe=probe, prior=prior)
    return (STRAIN_LIMIT - at_zero) / per_newton


def nominal_strains(surrogate: FullContactSurrogate, *, probe: Probe, prior: InclusionPrior) -> tuple[float, float]:
    """Nominal strain of tissue without inclusion at zero force, and its increase per newton."""
    at = (prior.tissue_young_kpa, prior.thickness_mm)

    def strain(approach_mm: Surrogate) -> float:
        return nominal_strain(float(approach_mm.baseline_at(*at)[0]), probe, prior.thickness_mm)

    at_zero = 0.0 if surrogate.shape is None else strain(surrogate.shape.approach_mm)
    return at_zero, strain(surrogate.unit.approach_mm)


def binary_image(image: TactileImage, threshold_grey: float) -> TactileImage:
    """Full scale where the image reaches the threshold, zero elsewhere (6.11).

    Parameters
    ----------
    image
        The image; the result has its scale, axis and full scale.
    threshold_grey
        In grey levels, at most the full scale above or below zero.

    Raises
    ------
    InputError
        When the threshold lies outside its range.

    Examples
    --------
    >>> from tsis.model.image import TactileImage
    >>> binary_image(TactileImage(grey=[[3.0, 5.0, 9.0]]), 5.0).grey.tolist()
    [[0.0, 255.0, 255.0]]
    """
    require_number("threshold_grey", threshold_grey, -image.full_scale, image.full_scale)
    return replace(image, grey=np.where(image.grey >= threshold_grey, image.full_scale, 0.0))


def binary_features(image: TactileImage, threshold_grey: float) -> Features:
    """Position and shape of the largest part above a threshold, which the whole picture must not exceed."""
    binary = binary_image(image, threshold_grey)
    if binary.grey.min() > 0:
        raise InputError(
            f"some of the picture must lie below the threshold of {threshold_grey:.4g} grey levels; "
            "got one with all pixels above it (cropped, overexposed, or with the wrong reference)"
        )
    return features(binary, method="half")


def averaged_errors(calibration: Calibration, frames: int) -> Calibration:
    """Errors of the mean of repeats: independent errors fall, gain and pattern stay.

    The likelihood is linear in the errors, so that the mean is sufficient.
    """
    fraction = 1 / np.sqrt(frames)
    return replace(
        calibration,
        repeatability_sd=fraction * calibration.repeatability_sd,
        force_sd=fraction * calibration.force_sd,
        offset_sd=fraction * calibration.offset_sd,
    )


def mean_of_repeats(
    targets: list[TactileImage], references: list[TactileImage], calibration: Calibration
) -> tuple[list[TactileImage], list[TactileImage], Calibration]:
    """Means of the frames of equal force of each site, where all are pressed equally often; else the same again.

    A pixel that is clipped in one frame is clipped in the mean.
    """
    groups = [Counter(frame.force_n for frame in frames) for frames in (targets, references)]
    counts = {count for group in groups for count in group.values()}
    repeats = counts.pop()
    if counts or repeats == 1:
        return targets, references, calibration

    def means(frames: list[TactileImage], forces: Iterable[float | None]) -> list[TactileImage]:
        return [_mean([frame for frame in frames if frame.force_n == force]) for force in forces]

    target_forces, reference_forces = groups
    return means(targets, target_forces), means(references, reference_forces), averaged_errors(calibration, repeats)


# What a press from the same place may differ by, beyond the calibration's errors, smoothly along the radius: a place
# that is 1 mm off, creep, a tilt. Repeats of the virtual probe differ by 1 %, presses of other lumps by 10 % and more.
REPEAT_SD, REPEAT_REACH = 0.01, 0.25  # relative, and its correlation length over the outer radius
REPEAT_SHAPES = 4


def repeats_chance(
    frames: list[TactileImage], calibration: Calibration, edges_mm: Floats, *, tissue_sd: float = 0.0
) -> float:
    """Chance of at least the scatter among frames of equal force of one site; 1 where no force is repeated.

    ``tissue_sd`` is by how much the tissue may differ from place to place, relative, where frames may be of several.
    """
    groups = [[frame for frame in frames if frame.force_n == force] for force in {frame.force_n for frame in frames}]
    light = ring_light(frames[0], calibration, edges_mm).level if frames else np.ones(0)
    middle = (edges_mm[1:] + edges_mm[:-1]) / 2
    along = np.exp(-np.abs(middle[:, None] - middle) / (REPEAT_REACH * edges_mm[-1]))
    square, freedom = 0.0, 0
    for group in groups:
        if len(group) < 2:
            continue
        data = ring_profiles(group, calibration, edges_mm, light=light, model_error=0.0)
        used = data.usable.all(axis=0)
        grey = data.grey[:, used]
        mean = grey.mean(axis=0)
        smooth = (REPEAT_SD**2 + tissue_sd**2) * along[np.ix_(used, used)]
        own = np.outer(mean, mean) * (
            smooth + calibration.force_sd**2 + calibration.repeatability_sd**2 * np.eye(mean.size)
        )
        own += (calibration.offset_sd * float(mean.mean())) ** 2 + np.diag(data.variance[:, used].mean(axis=0))
        size, shape = np.linalg.eigh(own)  # other presses differ smoothly: by the largest shapes of the errors
        square += float((np.square((grey - mean) @ shape[:, -REPEAT_SHAPES:]) / size[-REPEAT_SHAPES:]).sum())
        freedom += (len(group) - 1) * min(REPEAT_SHAPES, mean.size)
    return 1.0 if freedom == 0 else float(scipy.stats.chi2.sf(square, freedom))


def _mean(frames: list[TactileImage]) -> TactileImage:
    grey = np.array([frame.grey for frame in frames])
    clipped = (grey >= frames[0].full_scale).any(axis=0)
    return replace(frames[0], grey=np.where(clipped, frames[0].full_scale, grey.mean(axis=0)))
