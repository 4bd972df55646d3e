"""Guided calibrations at the bench: sessions on the disk, their steps as jobs, the calibration made from them."""

from tsis.console.services.calibrating._session import CalibrationSession, MadeCalibration, StepState
from tsis.console.services.calibrating._sessions import CalibrationSessions, SessionSummary

__all__ = ["CalibrationSession", "CalibrationSessions", "MadeCalibration", "SessionSummary", "StepState"]
