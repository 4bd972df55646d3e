"""Has a press settled, and how long is there to wait?"""

from tsis.calibration.settling._settling import BINS, LONGEST_HOLD_S, Settling, assess_history, judge_settling

__all__ = ["BINS", "LONGEST_HOLD_S", "Settling", "assess_history", "judge_settling"]
