"""The force line: sum of grey levels against force, and its measurement by loadings."""

from tsis.calibration.force._curves import HYSTERESIS_POINT, common_forces, fit_run, mean_value, usable_presses
from tsis.calibration.force._fit import GAUGE_ERROR, fit_force_line
from tsis.calibration.force._frame import HERTZ_SPREAD, MIDDLE, LoadingFrame, read_loading_frame, total_grey
from tsis.calibration.force._line import LARGEST_GAUGE_N, ForceLine, ForceLineDiagnostics, combine_variances
from tsis.calibration.force._loading import LARGEST_N, STEP_N, TIPS_MM, UNTOUCHED_N, Loading, loading_forces

__all__ = [
    "GAUGE_ERROR",
    "HERTZ_SPREAD",
    "HYSTERESIS_POINT",
    "LARGEST_GAUGE_N",
    "LARGEST_N",
    "MIDDLE",
    "STEP_N",
    "TIPS_MM",
    "UNTOUCHED_N",
    "ForceLine",
    "ForceLineDiagnostics",
    "Loading",
    "LoadingFrame",
    "combine_variances",
    "common_forces",
    "fit_force_line",
    "fit_run",
    "loading_forces",
    "mean_value",
    "read_loading_frame",
    "total_grey",
    "usable_presses",
]
