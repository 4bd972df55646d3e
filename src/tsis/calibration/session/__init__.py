"""A calibration step by step: what to do, the frames of each step on disk, and the calibration made from them."""

from tsis.calibration.session.folder import SessionFolder
from tsis.calibration.session.kept_result import archive_calibration, save_calibration, saved_calibration
from tsis.calibration.session.live_bench import LiveBench
from tsis.calibration.session.result import SessionResult, calibrate
from tsis.calibration.session.shot import CalibrationFrame
from tsis.calibration.session.steps import CalibrationStep, plan_steps
from tsis.calibration.session.terms import SessionSetup

__all__ = [
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
