"""Acquisition: a camera's frames in a ring, counted and monitored, so that every loss is reported."""

from tsis.instrument.acquisition._acquisition import LOST_AFTER_S, Acquisition
from tsis.instrument.acquisition._intake import Account, FrameRate, Intake, Interruption
from tsis.instrument.acquisition._ring import FrameRing, ReceivedFrame

__all__ = [
    "LOST_AFTER_S",
    "Account",
    "Acquisition",
    "FrameRate",
    "FrameRing",
    "Intake",
    "Interruption",
    "ReceivedFrame",
]
