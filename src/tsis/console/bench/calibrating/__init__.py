"""Guided calibrations at the bench: sessions on the disk, their steps as jobs, the calibration made from them."""

from tsis.console.bench.calibrating.session import CalibrationSession, MadeCalibration
from tsis.console.bench.calibrating.sessions import CalibrationSessions, SessionSummary
from tsis.console.bench.calibrating.step_state import StepState

__all__ = ["CalibrationSession", "CalibrationSessions", "MadeCalibration", "SessionSummary", "StepState"]
