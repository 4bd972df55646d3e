"""Read contact radius and force from one frame of a direct contact."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.errors import InputError
from tsis.imaging import features, find_contact
from tsis.imaging.profile import radial_profile
from tsis.model.press import MN_PER_N
from tsis.optics.angles import ERF_SLOPE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model.calibration import Calibration
    from tsis.model.image import TactileImage
    from tsis.model.probe import Probe


PATCH_RANGE = 1.35  # radii of the bright patch that contain all pressure: a patch cut at half the peak spans 0.87
FURTHER_MM = 0.3  # least distance and width of the ring around it that gives the stray light
RIM_MM = 1.0  # width of the face's edge that is not evaluated
BLUR_MM = 0.05  # default standard deviation of the lens's point spread on the face
BLUR_UNCERTAINTY = 0.3  # relative standard deviation of the point spread
STRAY_GREY = 0.01  # standard deviation of non-uniform stray light, grey levels
FULLEST, BRIGHTEST = 0.95, 0.999  # of the light of full contact: limit of a patch, and clip of the noise
DARKEST = 0.05  # of the brightest light: division by less only amplifies noise
ROUNDING = 1 / 12  # variance of rounding to whole grey levels


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactReading:
    """A contact measured in one frame.

    Attributes
    ----------
    radius_mm
        Radius of the Hertzian contact whose pressure has the same second moment; independent of gain and stray light.
    radius_sd
        Its relative standard deviation by noise, patterns and blur.
    light_force_n
        Integral of the pressure computed from the grey levels, N.
    light_force_sd
        Its relative standard deviation by noise and patterns, without the gain.
    extent_mm
        Radius of the evaluated disc.
    clipped_fraction
        Clipped fraction of the bright patch.
    axis_ratio
        Long over short semi-axis of the bright patch.
    """

    radius_mm: float
    radius_sd: float
    light_force_n: float
    light_force_sd: float
    extent_mm: float
    clipped_fraction: float
    axis_ratio: float


def read_contact(image: TactileImage, *, probe: Probe, calibration: Calibration, blur_mm: float) -> ContactReading:
    """Read the contact in a frame.

    The grey level of a pixel, less the stray light of the face around the contact, gives the pressure by the inverse of
    ``grey = light * gain * saturation * erf(0.886 p / saturation)``. Raises `InputError` when there is no contact, it
    leaves the picture or the face, or its light is saturated.

    Parameters
    ----------
    image
        A raw frame with its scale.
    probe
        The probe.
    calibration
        Response of grey level to pressure.
    blur_mm
        Standard deviation of the point spread on the face.
    """
    label = image.name or "an image"
    level = _evened(image, calibration)
    bright = features(level)
    if not bright.contact:
        raise InputError(f"images must show a contact; in {label!r} nothing stands out of the noise")
    circle = None if bright.cropped else find_contact(level, patch=bright.patch)
    if circle is None:
        raise InputError(
            f"the contact must lie inside the picture and be some pixels wide; in {label!r} it does not: centre the "
            "object, press less or use a lens with a wider field of view"
        )
    extent = PATCH_RANGE * float(np.sqrt((bright.area_mm2 or 0.0) / np.pi))
    _check_position(image, probe, circle.centre_px, extent)
    stray, stray_sd = _stray(level, probe, circle.centre_px, extent, calibration)
    fraction = (bright.peak - stray) / (calibration.gain_grey_per_kpa * calibration.saturation_kpa)
    if fraction > FULLEST:
        raise InputError(
            f"light must stay below saturation; in {label!r} it reaches {fraction:.2g} of that of full contact at "
            f"saturation_kpa = {calibration.saturation_kpa:g}: direct contact needs a rougher skin or less force"
        )
    moments = _moments(
        *_disc(level, circle.centre_px, extent, stray),
        pixel_mm2=float(np.prod(image.scale())),
        stray_sd=stray_sd,
        calibration=calibration,
        blur_mm=blur_mm,
    )
    long, short = bright.semi_axes_mm or (1.0, 1.0)
    return ContactReading(
        radius_mm=float(np.sqrt(2.5 * max(moments.spread, 1e-12))),
        radius_sd=moments.spread_sd / 2,
        light_force_n=moments.total / MN_PER_N,
        light_force_sd=moments.total_sd,
        extent_mm=extent,
        clipped_fraction=float(np.mean(image.grey[bright.patch.mask] >= image.full_scale)),
        axis_ratio=long / short,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Moments:
    """Force in mN and mean square radius in mm² of a pressure, each with its relative standard deviation."""

    total: float
    total_sd: float
    spread: float
    spread_sd: float


def _moments(
    grey: NDArray[np.float64],
    square: NDArray[np.float64],
    *,
    pixel_mm2: float,
    stray_sd: float,
    calibration: Calibration,
    blur_mm: float,
) -> _Moments:
    """Integrate the pressure pixel by pixel: rings would assume uniform pressure in each ring."""
    pressure, slope = _pressure(grey, calibration)
    force = pixel_mm2 * pressure
    total = float(force.sum())
    blurred = float((square * force).sum() / total)
    spread = blurred - 2 * blur_mm**2  # a point spread adds its own second moment
    noise = (calibration.read_noise_grey**2 + ROUNDING + calibration.shot_noise_grey * np.maximum(grey, 0)) / slope**2
    pattern = float(np.hypot(calibration.pattern_sd, calibration.repeatability_sd))
    grains = np.floor(np.sqrt(square) / calibration.grain_mm).astype(int)

    def relative_sd(by_pressure: NDArray[np.float64]) -> float:
        """Standard deviation of a logarithm with these derivatives: pixel noise, stray light, and grain patterns."""
        stray = stray_sd * float((by_pressure / slope).sum())
        grained = pattern * np.bincount(grains, weights=by_pressure * pressure)
        return float(np.sqrt((by_pressure**2 * noise).sum() + stray**2 + (grained**2).sum()))

    blur_sd = 4 * BLUR_UNCERTAINTY * blur_mm**2 / spread
    return _Moments(
        total=total,
        total_sd=relative_sd(np.full(len(grey), pixel_mm2 / total)),
        spread=spread,
        spread_sd=float(np.hypot(relative_sd(pixel_mm2 * (square - blurred) / (total * spread)), blur_sd)),
    )


def _disc(
    level: TactileImage, centre: tuple[float, float], extent: float, stray: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Grey levels above the stray light, and squared distances from the centre in mm², of the pixels of a disc."""
    (width, height), (rows, columns) = level.scale(), level.grey.shape
    square = ((np.arange(columns) - centre[0]) * width) ** 2 + ((np.arange(rows)[:, None] - centre[1]) * height) ** 2
    inside = square <= extent**2
    return level.grey[inside] - stray, square[inside]


def _evened(image: TactileImage, calibration: Calibration) -> TactileImage:
    """The frame less its background, corrected for non-uniform light."""
    grey = image.grey - calibration.background_grey
    if calibration.light is not None:
        axis, scale = image.axis(), image.scale()
        x = (np.arange(grey.shape[1]) - axis[0]) * scale[0]
        y = (np.arange(grey.shape[0]) - axis[1]) * scale[1]
        light = calibration.light.at(x, y)
        grey = grey / np.maximum(light, DARKEST * light.max())
    return replace(image, grey=grey, full_scale=65535.0)


def _check_position(image: TactileImage, probe: Probe, centre: tuple[float, float], extent: float) -> None:
    """Refuse a contact that leaves the picture or the face."""
    (width, height), label = image.scale(), image.name or "an image"
    rows, columns = image.grey.shape
    x, y = centre
    room = min(x * width, (columns - 1 - x) * width, y * height, (rows - 1 - y) * height)
    axis = image.axis()
    beside = float(np.hypot((x - axis[0]) * width, (y - axis[1]) * height))
    if extent / PATCH_RANGE > room:
        raise InputError(f"the contact must lie inside the picture; in {label!r} it leaves the field of view")
    if beside + extent > probe.radius_mm:
        raise InputError(
            f"the contact must lie inside the face of {probe.radius_mm:g} mm radius; in {label!r} it reaches "
            f"{beside + extent:.3g} mm: centre the object, press less or use a wider probe"
        )


def _stray(
    level: TactileImage, probe: Probe, centre: tuple[float, float], extent: float, calibration: Calibration
) -> tuple[float, float]:
    """Mean grey level of the face around the contact, and its standard deviation."""
    around = extent + FURTHER_MM
    beside = float(np.hypot(*(np.subtract(centre, level.axis()) * level.scale())))
    outer = max(around + FURTHER_MM, probe.radius_mm - RIM_MM - beside)
    ring = radial_profile(level, edges_mm=[around, outer], centre_px=centre)
    if not ring.count[0]:
        return 0.0, calibration.read_noise_grey
    noise = float(np.sqrt((calibration.read_noise_grey**2 + ROUNDING) / ring.count[0]))
    return float(ring.mean_grey[0]), float(np.hypot(noise, STRAY_GREY))


def _pressure(grey: NDArray[np.float64], calibration: Calibration) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Pressure in kPa, and grey levels per kPa, of each pixel."""
    fraction = grey / (calibration.gain_grey_per_kpa * calibration.saturation_kpa)
    argument = scipy.special.erfinv(np.clip(fraction, -BRIGHTEST, BRIGHTEST))
    slope = calibration.gain_grey_per_kpa * np.exp(-(argument**2))
    return np.asarray(calibration.saturation_kpa * argument / ERF_SLOPE), np.asarray(slope)
