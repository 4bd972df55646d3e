"""Camera, calibration, jobs and examinations behind the pages and the calls; no web imports."""

from tsis.console.services._camera import MOST_TYPED_N
from tsis.console.services._control import (
    LOCK_S,
    LONGEST_LOCK_S,
    LONGEST_OWNER_NAME,
    SHORTEST_LOCK_S,
    ControlLock,
    Owner,
)
from tsis.console.services._estimates import newest_presses, warm_up
from tsis.console.services._frame_analysis import ContactView, FrameAnalysis
from tsis.console.services._gel import GelAnalysis, GelSetup
from tsis.console.services._instrument import Instrument
from tsis.console.services._jobs import (
    DONE,
    ENDED,
    FAILED,
    RESULTS,
    Job,
    JobCancelled,
    Jobs,
    JobState,
    estimate_title,
    tissue_title,
)
from tsis.console.services._own_images import (
    IMAGE_ROLES,
    MOST_OWN_FRAMES,
    OPENABLE,
    OwnImage,
    measure_images,
    open_images,
    save_images,
)
from tsis.console.services._sequences import LONGEST_SEQUENCE_S, MOST_SEQUENCE_FRAMES, SHORTEST_SEQUENCE_S
from tsis.console.services._snapshots import SavedPress
from tsis.console.services._state import CameraState, InstrumentState
from tsis.console.services._subject import (
    BALL_MM,
    LIGHT_N,
    LONGEST_SPEC,
    CameraChoice,
    InstrumentSettings,
    PressForce,
    TissueReading,
    VirtualSubject,
)

__all__ = [
    "BALL_MM",
    "DONE",
    "ENDED",
    "FAILED",
    "IMAGE_ROLES",
    "LIGHT_N",
    "LOCK_S",
    "LONGEST_LOCK_S",
    "LONGEST_OWNER_NAME",
    "LONGEST_SEQUENCE_S",
    "LONGEST_SPEC",
    "MOST_OWN_FRAMES",
    "MOST_SEQUENCE_FRAMES",
    "MOST_TYPED_N",
    "OPENABLE",
    "RESULTS",
    "SHORTEST_LOCK_S",
    "SHORTEST_SEQUENCE_S",
    "CameraChoice",
    "CameraState",
    "ContactView",
    "ControlLock",
    "FrameAnalysis",
    "GelAnalysis",
    "GelSetup",
    "Instrument",
    "InstrumentSettings",
    "InstrumentState",
    "Job",
    "JobCancelled",
    "JobState",
    "Jobs",
    "OwnImage",
    "Owner",
    "PressForce",
    "SavedPress",
    "TissueReading",
    "VirtualSubject",
    "estimate_title",
    "measure_images",
    "newest_presses",
    "open_images",
    "save_images",
    "tissue_title",
    "warm_up",
]
