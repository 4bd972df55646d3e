"""From camera frames to ring profiles: what an estimate reads off the images."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import InputError
from tsis.imaging import radial_profile
from tsis.inclusion.posterior import Profiles, RingShading
from tsis.mechanics.small_strain import STRAIN_LIMIT, nominal_strain
from tsis.model import MN_PER_N, TactileImage

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from tsis.inclusion._prior import InclusionPrior
    from tsis.mechanics.surrogate import FullContactSurrogate, Surrogate
    from tsis.model import Calibration, LightMap, Probe


RINGS = 20
DARKEST = 1e-3  # of the brightest place; what is darker cannot be divided by
OUTER_FRACTION = (
    0.8  # of the face's radius; outside it the singular edge tells more about the rim than about the tissue
)


def ring_edges(probe: Probe) -> NDArray[np.float64]:
    """Boundaries in mm of the rings that the profile is averaged over."""
    return np.linspace(0.0, OUTER_FRACTION * probe.radius_mm, RINGS + 1)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RingLight:
    """How brightly each ring is lit, shape (rings,), and what a dent does to that."""

    level: NDArray[np.float64]
    shading: RingShading


def ring_light(frame: TactileImage, calibration: Calibration, edges_mm: NDArray[np.float64]) -> RingLight:
    """Means over the pixels of the frame in each ring; ones and no shading where the calibration names no light."""
    if calibration.light is None:
        none = np.zeros(len(edges_mm) - 1)
        return RingLight(level=none + 1, shading=RingShading(growth_per_mm=none, bend_per_mm2=none, flux=none))
    return _rings_of(calibration.light, frame.grey.shape, frame.scale(), frame.axis(), tuple(edges_mm.tolist()))


@lru_cache(maxsize=8)  # the frames of one camera share it
def _rings_of(
    light: LightMap,
    shape: tuple[int, int],
    scale: tuple[float, float],
    axis: tuple[float, float],
    edges_mm: tuple[float, ...],
) -> RingLight:
    frame = TactileImage(grey=np.zeros(shape), mm_per_pixel=scale, axis_px=axis, full_scale=65535.0)
    x, y = _pixels_mm(frame)
    relative, flux_x, flux_y, growth, bend = light.undented(x, y)
    outwards = relative * (flux_x * x + flux_y * y[:, None]) / np.maximum(np.hypot(x, y[:, None]), 1e-9)

    def mean(values: NDArray[np.floating[Any]], empty: float) -> NDArray[np.float64]:
        result = radial_profile(replace(frame, grey=np.asarray(values, dtype=float)), edges_mm=edges_mm).mean_grey
        return np.asarray(np.nan_to_num(result, nan=empty))

    level = mean(relative, 1.0)
    if level.min() <= DARKEST * level.max():
        raise InputError("light of the calibration must reach every ring of the face; got one that is dark")
    grows, bends, flux = (mean(part, 0.0) / level for part in (relative * growth, relative * bend, outwards))
    return RingLight(level=level, shading=RingShading(growth_per_mm=grows, bend_per_mm2=bends, flux=flux))


def depletion_per_n(calibration: Calibration, probe: Probe) -> float:
    """What each newton adds to the divisor of the light, per N, while contact is in proportion to pressure."""
    if calibration.light is None:
        return 0.0
    fraction = MN_PER_N / (np.pi * probe.radius_mm**2 * calibration.saturation_kpa)
    return calibration.light.depletion * float(fraction)


def _pixels_mm(frame: TactileImage) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Coordinates of the columns and of the rows from the probe's axis, mm."""
    (rows, columns), axis, (sx, sy) = frame.grey.shape, frame.axis(), frame.scale()
    return np.asarray((np.arange(columns) - axis[0]) * sx), np.asarray((np.arange(rows) - axis[1]) * sy)


def correct_light(frame: TactileImage, calibration: Calibration) -> TactileImage:
    """The frame above its background as even light would show it; clipped pixels can no longer be told in it."""
    if calibration.light is None:
        return frame
    light = calibration.light.at(*_pixels_mm(frame))
    floor = DARKEST * float(light.max())
    return replace(frame, grey=(frame.grey - calibration.background_grey) / np.maximum(light, floor))


def ring_profiles(
    frames: list[TactileImage],
    calibration: Calibration,
    edges_mm: NDArray[np.float64],
    *,
    light: NDArray[np.float64],
    model_error: float,
) -> Profiles:
    """Mean grey above background in each ring of each frame at even light, and which rings may be used.

    A ring's sum of grey over its sum of ``light`` is, with photon noise, the best mean of a round press.

    The error of the fast press model, a share of the pressure, counts as noise of each ring: a model that is coarse
    widens the intervals and does not shift them unseen.
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
    observed = np.nan_to_num(np.array([ring.mean_grey for ring in rings])) - calibration.background_grey
    pixel = calibration.read_noise_grey**2 + calibration.shot_noise_grey * np.maximum(observed, 0.0) + 1 / 12
    grey = observed / light
    variance = pixel / (np.maximum(count, 1) * light**2) + (model_error * grey) ** 2
    return Profiles(grey=grey, variance=variance, usable=usable)


def require_valid_forces(
    frames: Sequence[TactileImage], surrogate: FullContactSurrogate, *, probe: Probe, prior: InclusionPrior
) -> None:
    """Refuse forces that do not press the whole face onto the prior's plain tissue, or that strain it too much.

    Raises
    ------
    InputError
        Naming the frame and the range of forces.
    """
    least, most = covering_force_n(surrogate, prior, None), largest_force_n(surrogate, probe=probe, prior=prior)
    if least > most:
        raise InputError(
            f"no force serves this probe on tissue of {prior.tissue_young_kpa:g} kPa: its whole dome touches from "
            f"{_up(least):g} N on, and small strain holds up to {_down(most):g} N: use a flatter dome or stiffer tissue"
        )
    for frame in frames:
        force = frame.force_n or 0.0
        if not least <= force <= most:
            whole = f"from {_up(least):g} N, at which the whole dome touches, " if least > 0 else ""
            raise InputError(
                f"force_n must be {whole}up to {_down(most):g} N, a nominal strain of {STRAIN_LIMIT:g}, on tissue of "
                f"{prior.tissue_young_kpa:g} kPa; got {force:g} N for {frame.name or 'an image'!r}: press at a force "
                "in between"
            )


def _up(force_n: float) -> float:
    """Two digits, rounded so that the limit itself is accepted."""
    digit = 10 ** (np.floor(np.log10(force_n)) - 1)
    return float(np.format_float_positional(np.ceil(force_n / digit) * digit, precision=6))


def _down(force_n: float) -> float:
    digit = 10 ** (np.floor(np.log10(force_n)) - 1)
    return float(np.format_float_positional(np.floor(force_n / digit) * digit, precision=6))


def covering_force_n(
    surrogate: FullContactSurrogate,
    prior: InclusionPrior,
    inclusion: NDArray[np.float64] | None,
    *,
    stiffening: float = 1.0,
) -> float:
    """Force in newtons from which the contact covers the face, 0 of a flat one.

    ``inclusion`` holds diameter, depth and modulus; ``stiffening`` is the tissue's modulus over the prior's.
    """
    if surrogate.covering_force_n is None:
        return 0.0
    at = surrogate.covering_force_n.at_tissue(prior.tissue_young_kpa * stiffening, prior.thickness_mm)
    result = at.baseline if inclusion is None else at(*inclusion[:, None])[0]
    return float(result[0])


def largest_force_n(surrogate: FullContactSurrogate, *, probe: Probe, prior: InclusionPrior) -> float:
    """Force at which the nominal strain on plain tissue reaches the limit; none or less where the shape alone does."""
    at_none, per_newton = nominal_strains(surrogate, probe=probe, prior=prior)
    return (STRAIN_LIMIT - at_none) / per_newton


def nominal_strains(surrogate: FullContactSurrogate, *, probe: Probe, prior: InclusionPrior) -> tuple[float, float]:
    """Nominal strain of plain tissue at no force, and what each newton adds."""
    at = (prior.tissue_young_kpa, prior.thickness_mm)

    def strain(approach_mm: Surrogate) -> float:
        return nominal_strain(float(approach_mm.baseline_at(*at)[0]), probe, prior.thickness_mm)

    at_none = 0.0 if surrogate.shape is None else strain(surrogate.shape.approach_mm)
    return at_none, strain(surrogate.unit.approach_mm)
