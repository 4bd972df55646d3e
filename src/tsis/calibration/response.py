"""Fit of gain and saturation: saturation flattens the middle, the spread and the sum of a Hertzian contact's light.

Under ``p = p0 sqrt(1 - r**2 / a**2)`` rough contact shows ``g = erf(0.886 x s) / x`` with ``s = p / p0`` and
``x = p0 / saturation``, which is ``s`` for small x. All functions take ``x**2``: they are smooth through zero, so noise
may lead to slightly negative values.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.polynomial.legendre import leggauss

from tsis.calibration.force_line import GAUGE_ERROR, HERTZ_SPREAD, MIDDLE, combine_variances, fit_run, usable_presses
from tsis.calibration.measured import MeasuredValue
from tsis.errors import CalibrationError, InputError
from tsis.model.calibration import Calibration
from tsis.model.press import MN_PER_N
from tsis.model.require import require_number, require_type
from tsis.optics.angles import ERF_SLOPE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from tsis.calibration.camera_reference import CameraReference
    from tsis.calibration.force_line import Loading


NORMAL_95 = 1.96  # half width of a normal interval of 95 % in standard deviations
LEAST_SATURATION_KPA, LARGEST_SATURATION_KPA = 1e-3, 1e6
LOWEST, HIGHEST = -0.5, 4.0  # of x**2: beyond twice the saturation only its level remains
TABLE = 226
POINTS = 48
LEAST_FRACTION = 0.1  # of the largest force: below it the contact has too few pixels for a shape
FEWEST = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class Saturation:
    """Saturation of the real contact area, as the curvature of the response: ``bend = 1 / saturation**2``.

    Parameters
    ----------
    bend_per_kpa2
        The bend, 1/kPa²; consistent with zero when no press came near saturation.

    Examples
    --------
    >>> saturation = Saturation(bend_per_kpa2=MeasuredValue(value=1e-6, sd=1e-6))
    >>> saturation.value_kpa, round(saturation.interval()[0]), saturation.interval()[1]
    (1000.0, 581, inf)
    """

    bend_per_kpa2: MeasuredValue

    def __post_init__(self) -> None:
        require_type("bend_per_kpa2", self.bend_per_kpa2, MeasuredValue)

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """Ends in kPa; the upper end is infinite when a straight response cannot be excluded."""
        low, high = self.bend_per_kpa2.interval(level)
        return (
            1 / float(np.sqrt(high)) if high > 0 else LARGEST_SATURATION_KPA,
            1 / float(np.sqrt(low)) if low > 0 else float("inf"),
        )

    @property
    def identified(self) -> bool:
        """Whether the 95 % interval has an upper end."""
        return self.interval()[1] < np.inf

    @property
    def value_kpa(self) -> float:
        """Best value, kPa; where the bend is not positive, that of the upper end of its interval."""
        bend = self.bend_per_kpa2.value
        if bend <= 0:
            return self.interval()[0]
        return float(np.clip(1 / np.sqrt(bend), LEAST_SATURATION_KPA, LARGEST_SATURATION_KPA))


@dataclass(frozen=True, slots=True, kw_only=True)
class PressureResponse:
    """Rough-contact response of a probe: ``grey = light * gain * saturation * erf(0.886 p / saturation)``.

    Parameters
    ----------
    gain_grey_per_kpa
        Grey levels per kilopascal at small pressure under the mean light of the face.
    saturation
        Its saturation.
    repeatability_share
        Relative standard deviation from press to press.
    gauge_share
        Relative standard deviation of a force reading.
    """

    gain_grey_per_kpa: MeasuredValue
    saturation: Saturation
    repeatability_share: float
    gauge_share: float

    def calibration(self, reference: CameraReference, *, name: str, probe: str) -> Calibration:
        """The input of `tsis.inclusion.estimate` and `tsis.hardness.estimate`, for frames that `reference` corrected.

        Parameters
        ----------
        reference
            The probe's reference; corrected frames have neither background nor uneven light.
        name
            Identifies the calibration in every result.
        probe
            Name of the probe.
        """
        gain = self.gain_grey_per_kpa
        # The estimates assume a normal gain: as wide as the 95 % interval of Student's t.
        gain_sd = (gain.interval()[1] / gain.value - 1) / NORMAL_95
        return Calibration(
            gain_grey_per_kpa=gain.value,
            gain_sd=min(1.0, float(np.linalg.norm([gain_sd, self.repeatability_share, reference.drift_fraction]))),
            saturation_kpa=self.saturation.value_kpa,
            background_grey=0.0,
            force_sd=self.gauge_share,
            read_noise_grey=reference.read_noise_grey.value,
            shot_noise_grey=reference.shot_noise_grey.value,
            name=name,
            probe=probe,
        )


def light_fraction(square: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sum of the light over its value without saturation, for x² of any shape."""
    table = _table()
    return np.asarray(np.interp(square, table[0], table[1]))


def spread_factor(square: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean square distance from the centre over the contact's a²; 1 / HERTZ_SPREAD without saturation."""
    table = _table()
    return np.asarray(np.interp(square, table[0], table[2]))


def peakedness(square: NDArray[np.float64]) -> NDArray[np.float64]:
    """Level of the middle times the mean square distance over the sum; it falls as the light flattens."""
    table = _table()
    return np.asarray(np.interp(square, table[0], table[3]))


@lru_cache(maxsize=1)
def _table() -> tuple[NDArray[np.float64], ...]:
    """x², light fraction, spread factor, peakedness."""
    square = np.linspace(LOWEST, HIGHEST, TABLE)
    node, weight = leggauss(POINTS)
    u, w = (node + 1) / 2, weight / 2  # s of the contact; areas go with s ds
    light = _shown(square[:, None], u[None, :]) * u
    total = light @ w
    spread = (light * (1 - u**2)) @ w / total
    # The middle: s from sqrt(1 - m**2 a² spread) to 1; its radius follows the observed spread.
    least = np.sqrt(1 - MIDDLE**2 * HERTZ_SPREAD * spread)
    s = least[:, None] + (1 - least[:, None]) * u
    middle = ((_shown(square[:, None], s) * s) @ w) / (s @ w)
    return square, 3 * total, spread, middle * spread / (2 * np.pi * total)


def _shown(square: NDArray[np.float64], s: NDArray[np.float64]) -> NDArray[np.float64]:
    """``erf(0.886 x s) / x`` over x², continued to negative x²; its slope at zero is that of s."""
    root = ERF_SLOPE * np.sqrt(np.maximum(np.abs(square), 1e-12))
    bent = np.where(square >= 0, scipy.special.erf(root * s), scipy.special.erfi(root * s))
    return np.asarray(bent / root * np.sqrt(np.pi) / 2)


def fit_response(
    loadings: Sequence[Loading],
    *,
    reference: CameraReference,
    gauge_fraction: float = GAUGE_ERROR,
    area_fraction: float = 0.0,
) -> PressureResponse:
    """Fit gain and saturation to the loading branches; unloading may show memory and is left out.

    Raises `CalibrationError` when there are too few loadings or presses; `InputError` when the scale is not known.

    Parameters
    ----------
    loadings
        Loadings of rigid round tips, two or more, best of several radii: the smallest presses hardest.
    reference
        The reference that corrected the frames; its scale must be known.
    gauge_fraction
        Relative standard deviation of the force gauge's calibration.
    area_fraction
        Relative standard deviation of a pixel's area on the face, from the calibration of the scale.
    """
    if reference.mm_per_pixel is None:
        raise InputError("the reference's mm_per_pixel must be known for the gain; calibrate the scale first")
    if len(loadings) < 2:
        raise CalibrationError(f"the response to pressure needs at least 2 loadings; got {len(loadings)}")
    require_number("gauge_fraction", gauge_fraction, 0.0, 0.5, hint="a fraction of 1")
    require_number("area_fraction", area_fraction, 0.0, 0.5, hint="a fraction of 1")
    pixel = reference.mm_per_pixel[0] * reference.mm_per_pixel[1]
    saturation = _saturation(loadings, pixel)
    bend = saturation.bend_per_kpa2
    slopes = _slopes(loadings, bend.value)
    gain = float(slopes.mean())
    by_bend = (float(_slopes(loadings, bend.value + bend.sd).mean()) - gain) ** 2
    variance, freedom = combine_variances(
        (
            (float(np.var(slopes, ddof=1)) / len(slopes), len(slopes) - 1.0),
            (by_bend, bend.degrees_of_freedom),
            ((gauge_fraction**2 + area_fraction**2) * gain**2, np.inf),
        )
    )
    scale = pixel / MN_PER_N
    # Relative squares of the presses about the line of their run, over its largest sum.
    runs = [fit_run(loading) for loading in loadings]
    scatter = [np.mean(run.residual_grey**2) / float(run.total_grey.max()) ** 2 for run in runs]
    return PressureResponse(
        gain_grey_per_kpa=MeasuredValue(
            value=gain * scale, sd=float(np.sqrt(variance)) * scale, degrees_of_freedom=freedom, unit="grey/kPa"
        ),
        saturation=saturation,
        repeatability_share=float(np.sqrt(np.mean(scatter))),
        gauge_share=gauge_fraction,
    )


def _saturation(loadings: Sequence[Loading], pixel_mm2: float) -> Saturation:
    rows = [_shapes(loading, pixel_mm2) for loading in loadings]
    force, spread, shape, total = np.concatenate(rows, axis=1)
    if len(force) < FEWEST:
        raise CalibrationError(
            f"the saturation needs at least {FEWEST} presses that are seen and do not clip; got {len(force)}"
        )
    # A faint contact has a noisy shape: its variance falls about as the sum rises.
    weight = np.sqrt(total / total.max())
    scale = float((1.5 * force * MN_PER_N / (np.pi * HERTZ_SPREAD * spread)).max()) ** -2

    def residuals(unknown: NDArray[np.float64]) -> NDArray[np.float64]:
        square = _squares(force, spread, unknown[0] * scale)
        return np.asarray(weight * (np.log(shape) - np.log(peakedness(square)) - unknown[1] / spread))

    fit = scipy.optimize.least_squares(residuals, np.array([0.1, 0.0]), x_scale=np.array([0.1, 0.01]))
    freedom = len(force) - 2.0
    slopes = np.asarray(fit.jac)
    covariance = np.linalg.inv(slopes.T @ slopes) * float(2 * fit.cost) / freedom
    return Saturation(
        bend_per_kpa2=MeasuredValue(
            value=float(fit.x[0]) * scale,
            sd=float(np.sqrt(covariance[0, 0])) * scale,
            degrees_of_freedom=freedom,
            unit="1/kPa2",
        )
    )


def _shapes(loading: Loading, pixel_mm2: float) -> NDArray[np.float64]:
    """Force, mean square width, peakedness and sum of presses with a shape, shape (4, n)."""
    good = _rising(loading) & (loading.load_n >= LEAST_FRACTION * loading.load_n.max()) & (loading.mean_square_mm2 > 0)
    force, spread, total = loading.load_n[good], loading.mean_square_mm2[good], loading.total_grey[good]
    return np.array([force, spread, loading.peak_grey[good] * spread / (total * pixel_mm2), total])


def _rising(loading: Loading) -> NDArray[np.bool]:
    return np.asarray(usable_presses(loading) & loading.rising)


def _squares(force_n: NDArray[np.float64], spread_mm2: NDArray[np.float64], bend: float) -> NDArray[np.float64]:
    """Peak pressure over saturation, squared; the contact's radius follows from its spread, which saturation widens."""
    square = np.zeros_like(force_n)
    for _ in range(3):
        area = np.pi * spread_mm2 / spread_factor(square)
        square = np.clip(bend * (1.5 * force_n * MN_PER_N / area) ** 2, -HIGHEST, HIGHEST)
    return np.asarray(square)


def _slopes(loadings: Sequence[Loading], bend: float) -> NDArray[np.float64]:
    """Slope in grey levels per newton at small force of each tip, or of each repeat of a single tip."""
    slopes: dict[float, list[float]] = {}
    for loading in loadings:
        good = _rising(loading)
        force = loading.load_n[good]
        straight = loading.total_grey[good] / light_fraction(_squares(force, loading.mean_square_mm2[good], bend))
        slopes.setdefault(loading.tip_radius_mm, []).append(float(np.polyfit(force, straight, 1)[0]))
    if len(slopes) == 1:
        return np.array(next(iter(slopes.values())))
    return np.array([float(np.mean(of_tip)) for of_tip in slopes.values()])
