"""What makes a probe's grey levels mean something: scale, light, force, and whether a press is usable."""

from tsis.calibration.file import ProbeCalibration, read_calibration, write_calibration
from tsis.calibration.force import fit_force_line
from tsis.calibration.force_line import ForceLine, ForceLineDiagnostics
from tsis.calibration.force_loading import Loading
from tsis.calibration.force_reading import read_press, total_grey
from tsis.calibration.guard import check_press
from tsis.calibration.guard_flags import GuardFlag
from tsis.calibration.guard_limits import GuardLimits
from tsis.calibration.guard_reference import GuardReference
from tsis.calibration.guard_watch import PressWatch, WatchState
from tsis.calibration.measured import Measured
from tsis.calibration.reference import make_reference
from tsis.calibration.reference_value import Reference
from tsis.calibration.response import Response
from tsis.calibration.response_fit import fit_response
from tsis.calibration.scale import Scale, scale_from_ball, scale_from_dots
from tsis.calibration.specification import Specification

__all__ = [
    "ForceLine",
    "ForceLineDiagnostics",
    "GuardFlag",
    "GuardLimits",
    "GuardReference",
    "Loading",
    "Measured",
    "PressWatch",
    "ProbeCalibration",
    "Reference",
    "Response",
    "Scale",
    "Specification",
    "WatchState",
    "check_press",
    "fit_force_line",
    "fit_response",
    "make_reference",
    "read_calibration",
    "read_press",
    "scale_from_ball",
    "scale_from_dots",
    "total_grey",
    "write_calibration",
]
