"""A calibration step by step: what to do, the frames of each step on disk, and the calibration made from them."""

from tsis.calibration.session.folder import SessionFolder
from tsis.calibration.session.kept_result import keep_calibration, kept_calibration, set_aside
from tsis.calibration.session.live_bench import LiveBench
from tsis.calibration.session.result import SessionFindings, calibrate
from tsis.calibration.session.shot import Shot
from tsis.calibration.session.steps import Step, plan
from tsis.calibration.session.terms import SessionTerms

__all__ = [
    "LiveBench",
    "SessionFindings",
    "SessionFolder",
    "SessionTerms",
    "Shot",
    "Step",
    "calibrate",
    "keep_calibration",
    "kept_calibration",
    "plan",
    "set_aside",
]
