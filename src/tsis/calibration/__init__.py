"""What makes a probe's grey levels mean something: scale, light, force, and whether a press is usable."""

from tsis.calibration.file import ProbeCalibration, read_calibration, write_calibration
from tsis.calibration.force import (
    ForceLine,
    ForceLineDiagnostics,
    Loading,
    fit_force_line,
    read_loading_frame,
    total_grey,
)
from tsis.calibration.guard import GuardFlag, GuardLimits, GuardReference, PressWatch, WatchState, check_press
from tsis.calibration.lamps import ReferencePatch, drift_corrected, fit_warm_up, patch_ratio
from tsis.calibration.measured import MeasuredValue
from tsis.calibration.reference import CameraReference, make_reference
from tsis.calibration.response import PressureResponse, Saturation, fit_response
from tsis.calibration.scale import PixelScale, scale_from_ball, scale_from_dots
from tsis.calibration.settling import Settling, judge_settling
from tsis.calibration.specification import Specification, edge_width, frame_rate, specification_sheet

__all__ = [
    "CameraReference",
    "ForceLine",
    "ForceLineDiagnostics",
    "GuardFlag",
    "GuardLimits",
    "GuardReference",
    "Loading",
    "MeasuredValue",
    "PixelScale",
    "PressWatch",
    "PressureResponse",
    "ProbeCalibration",
    "ReferencePatch",
    "Saturation",
    "Settling",
    "Specification",
    "WatchState",
    "check_press",
    "drift_corrected",
    "edge_width",
    "fit_force_line",
    "fit_response",
    "fit_warm_up",
    "frame_rate",
    "judge_settling",
    "make_reference",
    "patch_ratio",
    "read_calibration",
    "read_loading_frame",
    "scale_from_ball",
    "scale_from_dots",
    "specification_sheet",
    "total_grey",
    "write_calibration",
]
