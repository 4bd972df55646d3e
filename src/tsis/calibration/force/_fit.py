"""The force line by the loading procedure of section 5.1: sum of grey levels against force.

Errors of one run are correlated: the lamps drift, the light at the tip's position differs, the probe has memory. The
standard deviation of least squares assumes independent errors and would be several times too small. The unit of the
statistics is therefore the tip (its repeats averaged), with a line for each tip. The result is the mean of the lines;
its uncertainty follows from their scatter by Student's t.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.calibration._measured import MeasuredValue
from tsis.calibration.force._curves import (
    CLIPPED_FRACTION,
    LoadingRun,
    detectable_n,
    fit_run,
    loading_hysteresis,
    loading_linearity,
    loading_repeatability,
    spread_value,
    tip_difference,
)
from tsis.calibration.force._line import ForceLine, ForceLineDiagnostics, combine_variances
from tsis.calibration.force._loading import Loading
from tsis.errors import CalibrationError
from tsis.model.require import require_number, require_type

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from tsis.calibration.reference import CameraReference


GAUGE_ERROR = 0.001  # of the reading: a gauge of class 0.1 %
PRINTED_TIP_ERROR = 0.0245  # the source's difference between two tips, assumed where one tip was used


def fit_force_line(
    loadings: Sequence[Loading],
    *,
    reference: CameraReference,
    gauge_fraction: float = GAUGE_ERROR,
    drift_fraction: float | None = None,
    method: str = "threshold",
) -> tuple[ForceLine, ForceLineDiagnostics]:
    """Fit ``sum = a + b F`` to loadings and unloadings of one or more tips.

    Parameters
    ----------
    loadings
        At least two: different tips, best of 2, 10 and 14 mm radius, or repeats of one.
    reference
        The reference that corrected the frames.
    gauge_fraction
        Relative standard deviation of the force gauge's calibration, from its certificate.
    drift_fraction
        Relative standard deviation of the lamps after correction, between the reference and a later frame; that of
        ``reference`` when None.
    method
        Segmentation method of `tsis.calibration.force.read_loading_frame`.

    Returns
    -------
    The line, and its diagnostics.

    Raises
    ------
    CalibrationError
        When there are fewer than two loadings, when presses are too few or clip, or the sum does not rise.
    InputError
        When forces are in another unit.
    """
    for loading in loadings:
        require_type("loadings", loading, Loading)
    if len(loadings) < 2:
        raise CalibrationError(
            f"a force line needs at least 2 loadings, of two tips or repeats of one, for the lamps' drift hides in the "
            f"slope of a single one; got {len(loadings)}"
        )
    gauge = require_number("gauge_fraction", gauge_fraction, 0.0, 0.5, hint="a fraction of 1")
    runs = [fit_run(loading) for loading in loadings]
    tips = tuple(sorted({run.tip_mm for run in runs}))
    units = _units(runs)
    intercept, slope, covariance = _mean_line(units, gauge)
    residual_grey, residual_fraction = _residuals(runs, slope.value)
    detectable = detectable_n(loadings, slope.value)
    least, most, saturated = _range(loadings, detectable)
    line = ForceLine(
        intercept_grey=intercept,
        slope_grey_per_n=slope,
        unit_covariance=(float(covariance[0, 0]), float(covariance[0, 1]), float(covariance[1, 1])),
        units=len(units),
        assumed_tip_share=PRINTED_TIP_ERROR if len(tips) == 1 else 0.0,
        residual_grey=residual_grey,
        residual_share=residual_fraction,
        drift_share=reference.drift_fraction if drift_fraction is None else drift_fraction,
        gauge_share=gauge,
        least_n=least,
        most_n=most,
        pixels=int(reference.dark_grey.size),
        full_scale=reference.full_scale,
        tips_mm=tips,
        method=method,
    )
    return line, _diagnostics(runs, line, detectable, saturated=saturated)


def _units(runs: Sequence[LoadingRun]) -> NDArray[np.float64]:
    """Intercept and slope of each tip, or of each repeat of a single tip, shape (units, 2)."""
    lines = np.array([(run.intercept, run.slope) for run in runs])
    tips = np.array([run.tip_mm for run in runs])
    if len(set(tips.tolist())) == 1:
        return lines
    return np.array([lines[tips == tip].mean(axis=0) for tip in sorted(set(tips.tolist()))])


def _mean_line(units: NDArray[np.float64], gauge: float) -> tuple[MeasuredValue, MeasuredValue, NDArray[np.float64]]:
    """Mean intercept and slope over the units, and the covariance of single units."""
    covariance = np.cov(units, rowvar=False)
    intercept, slope = (float(value) for value in units.mean(axis=0))
    count, freedom = len(units), len(units) - 1.0
    variance, slope_freedom = combine_variances(
        ((float(covariance[1, 1]) / count, freedom), ((gauge * slope) ** 2, np.inf))
    )
    return (
        MeasuredValue(
            value=intercept, sd=float(np.sqrt(covariance[0, 0] / count)), degrees_of_freedom=freedom, unit="grey"
        ),
        MeasuredValue(value=slope, sd=float(np.sqrt(variance)), degrees_of_freedom=slope_freedom, unit="grey/N"),
        covariance,
    )


def _residuals(runs: Sequence[LoadingRun], slope: float) -> tuple[MeasuredValue, MeasuredValue]:
    """Scatter of presses about the line of their run: a constant part, and a part proportional to the sum."""
    light = np.concatenate([slope * run.force_n for run in runs])
    squares = np.concatenate(
        [run.residual_grey**2 * len(run.residual_grey) / (len(run.residual_grey) - 2) for run in runs]
    )
    expected = np.full(len(light), float(squares.mean()))
    design = np.stack([np.ones_like(light), light**2], axis=1)
    parts = np.zeros(2)
    for _ in range(5):  # the variance of a square grows with its expectation
        scale = np.linalg.norm(design / expected[:, None], axis=0)
        parts = scipy.optimize.nnls(design / expected[:, None] / scale, squares / expected)[0] / scale
        expected = np.maximum(design @ parts, 1e-6 * float(squares.mean()) + 1e-12)
    freedom = len(light) - 2.0 * len(runs)
    return spread_value(float(parts[0]), freedom, unit="grey"), spread_value(float(parts[1]), freedom)


def _range(loadings: Sequence[Loading], detectable: MeasuredValue | None) -> tuple[float, float, bool]:
    """Smallest and largest force of the line's range, and whether clipping limits it."""
    touched = np.concatenate([loading.load_n[loading.touched] for loading in loadings])
    detected = np.concatenate([loading.total_grey[loading.touched] > 0 for loading in loadings])
    clipped = np.concatenate([loading.clipped[loading.touched] > CLIPPED_FRACTION for loading in loadings])
    whole = touched[~clipped & (touched < touched[clipped].min())] if clipped.any() else touched
    undetected = touched[~detected]
    dark_end = float(undetected.max()) if undetected.size else 0.0
    visible = touched[detected & (touched > dark_end)]
    least = max(float(visible.min()), 0.0 if detectable is None else detectable.value)
    most = float(whole.max()) if whole.size else 0.0
    if most <= least:
        raise CalibrationError(
            f"no range of force is left between {least:.3g} N, the smallest that is seen, and {most:.3g} N, the "
            "largest that does not clip (change the exposure)"
        )
    return least, most, bool(clipped.any())


def _diagnostics(
    runs: Sequence[LoadingRun], line: ForceLine, detectable: MeasuredValue | None, *, saturated: bool
) -> ForceLineDiagnostics:
    force = np.concatenate([run.force_n for run in runs])
    total = np.concatenate([run.total_grey for run in runs])
    residuals = total - line.intercept_grey.value - line.slope_grey_per_n.value * force
    own = np.concatenate([run.residual_grey for run in runs])
    return ForceLineDiagnostics(
        residual_sd_grey=float(np.sqrt(np.sum(own**2) / max(1, len(own) - 2 * len(runs)))),
        r_squared=float(1 - residuals.var() / total.var()),
        linearity=loading_linearity(runs),
        exponent=float(np.polyfit(np.log(np.maximum(force, 1e-6)), np.log(total), 1)[0]),
        hysteresis=loading_hysteresis(runs),
        repeatability=loading_repeatability(runs),
        tip_difference=tip_difference(runs),
        detectable_n=detectable,
        saturated=saturated,
    )
