"""Has a press settled, and how long is there to wait?"""

from tsis.calibration.settling.verdict import Settling, judge_settling

__all__ = [
    "Settling",
    "judge_settling",
]
