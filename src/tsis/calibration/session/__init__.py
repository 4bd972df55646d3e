"""A calibration session: its steps, their frames on disk, and the calibration computed from them."""

from tsis.calibration.session._folder import (
    CalibrationFrame,
    SessionFolder,
    archive_calibration,
    save_calibration,
    saved_calibration,
)
from tsis.calibration.session._live_bench import LiveCalibration
from tsis.calibration.session._result import SessionResult, calibrate
from tsis.calibration.session._setup import (
    BOARD,
    BOARD_UNTOUCHED,
    DARK,
    EDGE,
    FLAT,
    PAD_FORCES_N,
    UNTOUCHED,
    CalibrationStep,
    SessionSetup,
    plan_steps,
)

__all__ = [
    "BOARD",
    "BOARD_UNTOUCHED",
    "DARK",
    "EDGE",
    "FLAT",
    "PAD_FORCES_N",
    "UNTOUCHED",
    "CalibrationFrame",
    "CalibrationStep",
    "LiveCalibration",
    "SessionFolder",
    "SessionResult",
    "SessionSetup",
    "archive_calibration",
    "calibrate",
    "plan_steps",
    "save_calibration",
    "saved_calibration",
]
