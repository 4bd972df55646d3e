"""The instrument behind the pages: who holds it, its camera, what is kept. It knows no page and no web."""

from tsis.console.services._camera import MOST_TYPED_N
from tsis.console.services._control import HELD_S, LONGEST_HELD_S, LONGEST_NAME, SHORTEST_HELD_S, Control, Holder
from tsis.console.services._estimates import estimate_title, newest_presses
from tsis.console.services._frame_analysis import Sight
from tsis.console.services._instrument import Bench
from tsis.console.services._jobs import DONE, ENDED, FAILED, RESULTS, Ended, Job, Jobs, JobState
from tsis.console.services._sequences import LONGEST_S, MOST_FRAMES, SHORTEST_S
from tsis.console.services._snapshots import Kept
from tsis.console.services._state import BenchState, CameraState
from tsis.console.services._subject import BALL_MM, LONGEST_SPEC, CameraChoice, VirtualStage
from tsis.console.services._terms import BenchTerms

__all__ = [
    "BALL_MM",
    "DONE",
    "ENDED",
    "FAILED",
    "HELD_S",
    "LONGEST_HELD_S",
    "LONGEST_NAME",
    "LONGEST_S",
    "LONGEST_SPEC",
    "MOST_FRAMES",
    "MOST_TYPED_N",
    "RESULTS",
    "SHORTEST_HELD_S",
    "SHORTEST_S",
    "Bench",
    "BenchState",
    "BenchTerms",
    "CameraChoice",
    "CameraState",
    "Control",
    "Ended",
    "Holder",
    "Job",
    "JobState",
    "Jobs",
    "Kept",
    "Sight",
    "VirtualStage",
    "estimate_title",
    "newest_presses",
]
