"""The press guard: named flags on one frame or live, with all thresholds in one module."""

from tsis.calibration.guard._check import check_press, guard_reference, press_watch, with_calibrated_scale
from tsis.calibration.guard._flags import GUARD_FLAGS, GuardFlag, GuardLimits
from tsis.calibration.guard._reference import FrameShape, GuardReference
from tsis.calibration.guard._watch import PressHistory, PressWatch, WatchState

__all__ = [
    "GUARD_FLAGS",
    "FrameShape",
    "GuardFlag",
    "GuardLimits",
    "GuardReference",
    "PressHistory",
    "PressWatch",
    "WatchState",
    "check_press",
    "guard_reference",
    "press_watch",
    "with_calibrated_scale",
]
