"""A calibration step by step: what to do, the frames of each step on disk, and the calibration made from them."""

from tsis.calibration.session._folder import (
    CalibrationFrame,
    SessionFolder,
    archive_calibration,
    save_calibration,
    saved_calibration,
)
from tsis.calibration.session._live_bench import LiveBench
from tsis.calibration.session._result import DAYS, SessionResult, calibrate
from tsis.calibration.session._setup import (
    BOARD,
    BOARD_UNTOUCHED,
    DARK,
    EDGE,
    FLAT,
    UNTOUCHED,
    CalibrationStep,
    SessionSetup,
    plan_steps,
)

__all__ = [
    "BOARD",
    "BOARD_UNTOUCHED",
    "DARK",
    "DAYS",
    "EDGE",
    "FLAT",
    "UNTOUCHED",
    "CalibrationFrame",
    "CalibrationStep",
    "LiveBench",
    "SessionFolder",
    "SessionResult",
    "SessionSetup",
    "archive_calibration",
    "calibrate",
    "plan_steps",
    "save_calibration",
    "saved_calibration",
]
