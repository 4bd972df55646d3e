"""Is a press usable? Named flags on one frame or live, all thresholds in one place."""

from tsis.calibration.guard.blocks import FrameShape
from tsis.calibration.guard.flags import FLAGS, GuardFlag
from tsis.calibration.guard.limits import GuardLimits
from tsis.calibration.guard.press_check import check_press
from tsis.calibration.guard.reference import GuardReference
from tsis.calibration.guard.watch import PressWatch, WatchState

__all__ = [
    "FLAGS",
    "FrameShape",
    "GuardFlag",
    "GuardLimits",
    "GuardReference",
    "PressWatch",
    "WatchState",
    "check_press",
]
