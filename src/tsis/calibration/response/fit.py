"""From loadings to the probe's answer: gain at small pressure and where it saturates.

Saturation is told from the shape of single pictures: a contact that saturates is flatter than Hertz's half-ellipse, so
that its middle times its mean square width over its sum, `peakedness`, falls with the square of peak pressure over
saturation. That number knows nothing of gain, lamps, tip or gauge. The lens's blur also changes it, but in proportion
to blur over contact area and not to pressure, so both are fitted. The gain is then the slope of sums that were
corrected for saturation, one tip a unit as in `tsis.calibration.force.fit`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import least_squares

from tsis.calibration.force.curves import run_of, usable
from tsis.calibration.force.fit import GAUGE_SHARE
from tsis.calibration.force.line import joined
from tsis.calibration.force.reading import HERTZ_SPREAD
from tsis.calibration.measured import MeasuredValue
from tsis.calibration.response.shape import HIGHEST, light_share, peakedness, spread_factor
from tsis.calibration.response.value import PressureResponse, Saturation
from tsis.model.check import require_number
from tsis.model.errors import CalibrationError, InputError
from tsis.model.press import MN_PER_N

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from tsis.calibration.force.loading import Loading
    from tsis.calibration.reference.making import CameraReference

LEAST_SHARE = 0.1  # of the largest force: below it the contact holds too few pixels to have a shape
FEWEST = 6


def fit_response(
    loadings: Sequence[Loading],
    *,
    reference: CameraReference,
    gauge_share: float = GAUGE_SHARE,
    area_share: float = 0.0,
) -> PressureResponse:
    """Fit gain and saturation to the loading branches; unloading, which may remember, is left out.

    Parameters
    ----------
    loadings
        Loadings of rigid round tips, two or more, best of several radii: the smallest presses hardest.
    reference
        What corrected the frames; its scale must be known.
    gauge_share
        Relative standard deviation of the force gauge's calibration.
    area_share
        Relative standard deviation of the area of a pixel on the face, from the calibration of the scale.

    Raises
    ------
    CalibrationError
        When there are too few loadings or presses.
    InputError
        When the scale is not known.
    """
    if reference.mm_per_pixel is None:
        raise InputError("the reference's mm_per_pixel must be known for the gain; calibrate the scale first")
    if len(loadings) < 2:
        raise CalibrationError(f"the answer to pressure needs at least 2 loadings; got {len(loadings)}")
    require_number("gauge_share", gauge_share, 0.0, 0.5, hint="a share of one")
    require_number("area_share", area_share, 0.0, 0.5, hint="a share of one")
    pixel = reference.mm_per_pixel[0] * reference.mm_per_pixel[1]
    saturation = _saturation(loadings, pixel)
    bend = saturation.bend_per_kpa2
    slopes = _slopes(loadings, bend.value)
    gain = float(slopes.mean())
    by_bend = (float(_slopes(loadings, bend.value + bend.sd).mean()) - gain) ** 2
    variance, freedom = joined(
        (
            (float(np.var(slopes, ddof=1)) / len(slopes), len(slopes) - 1.0),
            (by_bend, bend.degrees_of_freedom),
            ((gauge_share**2 + area_share**2) * gain**2, np.inf),
        )
    )
    scale = pixel / MN_PER_N
    return PressureResponse(
        gain_grey_per_kpa=MeasuredValue(
            value=gain * scale, sd=float(np.sqrt(variance)) * scale, degrees_of_freedom=freedom, unit="grey/kPa"
        ),
        saturation=saturation,
        repeatability_share=_scatter(loadings),
        gauge_share=gauge_share,
    )


def _saturation(loadings: Sequence[Loading], pixel_mm2: float) -> Saturation:
    rows = [_shapes(one, pixel_mm2) for one in loadings]
    force, spread, shape, total = np.concatenate(rows, axis=1)
    if len(force) < FEWEST:
        raise CalibrationError(
            f"the saturation needs at least {FEWEST} presses that are seen and do not clip; got {len(force)}"
        )
    # Where little light shines the shape is noisy: its variance falls about as the sum rises.
    weight = np.sqrt(total / total.max())
    scale = float((1.5 * force * MN_PER_N / (np.pi * HERTZ_SPREAD * spread)).max()) ** -2

    def left(unknown: NDArray[np.float64]) -> NDArray[np.float64]:
        square = _squares(force, spread, unknown[0] * scale)
        return np.asarray(weight * (np.log(shape) - np.log(peakedness(square)) - unknown[1] / spread))

    found = least_squares(left, np.array([0.1, 0.0]), x_scale=np.array([0.1, 0.01]))
    freedom = len(force) - 2.0
    slopes = np.asarray(found.jac)
    covariance = np.linalg.inv(slopes.T @ slopes) * float(2 * found.cost) / freedom
    return Saturation(
        bend_per_kpa2=MeasuredValue(
            value=float(found.x[0]) * scale,
            sd=float(np.sqrt(covariance[0, 0])) * scale,
            degrees_of_freedom=freedom,
            unit="1/kPa2",
        )
    )


def _shapes(loading: Loading, pixel_mm2: float) -> NDArray[np.float64]:
    """Force, mean square width, peakedness and sum of presses that have a shape, shape (4, n)."""
    good = _rising(loading) & (loading.load_n >= LEAST_SHARE * loading.load_n.max()) & (loading.mean_square_mm2 > 0)
    force, spread, total = loading.load_n[good], loading.mean_square_mm2[good], loading.total_grey[good]
    return np.array([force, spread, loading.peak_grey[good] * spread / (total * pixel_mm2), total])


def _rising(loading: Loading) -> NDArray[np.bool]:
    return np.asarray(usable(loading) & loading.rising)


def _squares(force_n: NDArray[np.float64], spread_mm2: NDArray[np.float64], bend: float) -> NDArray[np.float64]:
    """Peak pressure over saturation, squared; the contact's radius follows from its spread, which saturation widens."""
    square = np.zeros_like(force_n)
    for _ in range(3):
        area = np.pi * spread_mm2 / spread_factor(square)
        square = np.clip(bend * (1.5 * force_n * MN_PER_N / area) ** 2, -HIGHEST, HIGHEST)
    return np.asarray(square)


def _slopes(loadings: Sequence[Loading], bend: float) -> NDArray[np.float64]:
    """Slope in grey levels a newton at small force of each tip, or of each repeat when there is one tip."""
    slopes: dict[float, list[float]] = {}
    for loading in loadings:
        good = _rising(loading)
        force = loading.load_n[good]
        straight = loading.total_grey[good] / light_share(_squares(force, loading.mean_square_mm2[good], bend))
        slopes.setdefault(loading.tip_radius_mm, []).append(float(np.polyfit(force, straight, 1)[0]))
    if len(slopes) == 1:
        return np.array(next(iter(slopes.values())))
    return np.array([float(np.mean(of_tip)) for of_tip in slopes.values()])


def _scatter(loadings: Sequence[Loading]) -> float:
    """Relative scatter of presses about the line of their run, each at the largest force of its run."""
    runs = [run_of(loading) for loading in loadings]
    return float(np.sqrt(np.mean([np.mean(run.left**2) / float(run.total_grey.max()) ** 2 for run in runs])))
