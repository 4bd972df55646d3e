"""The force line: which force makes which sum of grey levels, and how that is measured."""

from tsis.calibration.force._curves import HYSTERESIS_POINT, common_forces, mean_of, run_of, usable
from tsis.calibration.force._fit import GAUGE_ERROR, fit_force_line
from tsis.calibration.force._frame import HERTZ_SPREAD, MIDDLE, LoadingFrame, read_loading_frame, total_grey
from tsis.calibration.force._line import LARGEST_GAUGE_N, ForceLine, ForceLineDiagnostics, joined
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
    "common_forces",
    "fit_force_line",
    "joined",
    "loading_forces",
    "mean_of",
    "read_loading_frame",
    "run_of",
    "total_grey",
    "usable",
]
