"""Guided calibrations: sessions on the disk, their steps as jobs, the calibration computed from them."""

from tsis.console.services.calibrating._session import CalibrationResult, CalibrationSession, StepState
from tsis.console.services.calibrating._sessions import CalibrationSessions, SessionSummary

__all__ = ["CalibrationResult", "CalibrationSession", "CalibrationSessions", "SessionSummary", "StepState"]
