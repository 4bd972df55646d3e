"""The instrument behind the pages: who holds it, its camera, what is kept. It knows no page and no web."""

from tsis.console.bench.bench import Bench
from tsis.console.bench.choice import CameraChoice
from tsis.console.bench.control import Control, Holder
from tsis.console.bench.jobs import Job, Jobs, JobState
from tsis.console.bench.state import BenchState, CameraState
from tsis.console.bench.terms import BenchTerms

__all__ = [
    "Bench",
    "BenchState",
    "BenchTerms",
    "CameraChoice",
    "CameraState",
    "Control",
    "Holder",
    "Job",
    "JobState",
    "Jobs",
]
