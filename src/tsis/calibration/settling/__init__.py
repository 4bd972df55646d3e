"""Settling of a press: whether it has settled, and the time still to wait."""

from tsis.calibration.settling._settling import BINS, LONGEST_HOLD_S, Settling, assess_history, assess_settling

__all__ = ["BINS", "LONGEST_HOLD_S", "Settling", "assess_history", "assess_settling"]
