"""What the instrument says: the state of the camera and of everything."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.calibration.frames import UsableCalibration
from tsis.console.services.choice import UNTOUCHED, CameraChoice
from tsis.console.services.memory import TissueReading
from tsis.instrument.camera import Setting

if TYPE_CHECKING:
    from tsis.console.services.camera import CameraController
    from tsis.console.services.control import Owner
    from tsis.console.services.frames import FrameAnalysis
    from tsis.console.services.jobs import JobState


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraState:
    """State of the camera.

    Attributes
    ----------
    choice
        Which camera was chosen.
    name
        Its name; empty while it is stopped.
    mode, modes
        Label of its mode, and of all its modes; empty while it is stopped.
    running
        Whether the camera streams.
    lost
        Whether a running camera sends no frames; the program connects it again.
    failure
        Why the last frames stayed away; empty when none did.
    received
        Complete frames.
    missed
        Frames that the camera numbered and that did not arrive.
    interruptions
        How often the camera was lost.
    frames_per_s
        Rate over the last two seconds.
    rows, columns
        Size of a frame in pixels; 0 before the first.
    full_scale
        Grey level at which the camera clips; 0 before the first frame.
    mm_per_pixel
        Size (x, y) of a pixel on the face; None when nobody knows it.
    settings
        What can be adjusted now.
    """

    choice: CameraChoice
    name: str = ""
    mode: str = ""
    modes: tuple[str, ...] = ()
    running: bool = False
    lost: bool = False
    failure: str = ""
    received: int = 0
    missed: int = 0
    interruptions: int = 0
    frames_per_s: float = 0.0
    rows: int = 0
    columns: int = 0
    full_scale: float = 0.0
    mm_per_pixel: tuple[float, float] | None = None
    settings: tuple[Setting, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class InstrumentState:
    """State of the instrument.

    Attributes
    ----------
    target
        Number of the target that snapshots go to.
    role, roles
        What is pressed, and what may be.
    force_n
        As typed, or that of the virtual probe, which for "untouched" stays for the next press; None when unknown.
    calibration, calibration_identity
        Name and SHA-256 of the active one; empty without one, and while the chosen one does not fit the camera's
        settings, as ``trouble`` says.
    sequence
        The running or last sequence; None before the first.
    jobs
        Longer work, the newest last.
    trouble
        Messages of problems, the most urgent first.
    busy
        The running command that others must wait for, as ``"starting the camera"``; empty without one.
    gauge
        Name of the gauge that forces are read from; empty without one.
    active, tissue
        The active calibration itself, and the target's tissue as a light press showed it; None without.
    """

    camera: CameraState
    target: int
    role: str
    roles: tuple[str, ...]
    force_n: float | None
    calibration: str
    calibration_identity: str
    frame_analysis: FrameAnalysis | None
    owner: Owner | None
    sequence: JobState | None
    jobs: tuple[JobState, ...]
    trouble: tuple[str, ...]
    busy: str = ""
    gauge: str = ""
    active: UsableCalibration | None = None
    tissue: TissueReading | None = None

    @property
    def lifted(self) -> bool:
        """Whether the virtual probe touches nothing: its force is 0 then, whatever is set for the next press."""
        return self.camera.choice.is_virtual and self.role == UNTOUCHED


def camera_state(camera_controller: CameraController, mm_per_pixel: tuple[float, float] | None) -> CameraState:
    """State of the camera, with the size (x, y) of its pixels in mm; it never waits for the camera."""
    # Asked once: it may be stopped, or be another one, the moment after.
    acquisition, choice = camera_controller.acquisition, camera_controller.choice
    if acquisition is None:
        return CameraState(choice=choice, mm_per_pixel=mm_per_pixel)
    account, latest, mode, failure = acquisition.account(), acquisition.latest(), acquisition.mode, acquisition.failure
    rows, columns = (0, 0) if latest is None else latest.frame.pixels.shape[:2]
    return CameraState(
        choice=choice,
        name=acquisition.name,
        mode="" if mode is None else mode.label,
        modes=tuple(mode.label for mode in acquisition.modes),
        running=True,
        lost=acquisition.lost or acquisition.ended,
        failure="" if failure is None else str(failure),
        received=account.received,
        missed=account.missed,
        interruptions=len(account.interruptions),
        frames_per_s=account.frames_per_s,
        rows=rows,
        columns=columns,
        full_scale=0.0 if latest is None else latest.frame.full_scale,
        mm_per_pixel=mm_per_pixel,
        settings=camera_controller.settings(),
    )
