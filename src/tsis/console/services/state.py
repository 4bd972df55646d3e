"""What the instrument says of its state, and what is wrong."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.calibration.frames import UsableCalibration
from tsis.console.services.choice import UNTOUCHED, CameraChoice
from tsis.console.services.memory import TissueReading
from tsis.files.reading import printable_path
from tsis.instrument.camera import Setting
from tsis.instrument.force_log import ForceLog
from tsis.records.store import Store

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

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
    trouble, notices, good_news
        Messages of problems, the most urgent first; those of the start, which go when they are read or work begins;
        those that ask nothing of anybody.
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
    notices: tuple[str, ...] = ()
    good_news: tuple[str, ...] = ()

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


STORE_CHECK_EVERY_S = 1.0  # the state is read more often


class StoreCheck:
    """Checks at intervals whether the store is still where it was opened; ``clock`` gives seconds."""

    def __init__(self, store: Store, *, clock: Callable[[], float] = time.monotonic) -> None:
        self._store, self._clock = store, clock
        self._last = (clock(), False)

    def trouble(self) -> str:
        """Where it is gone from; empty while it is there."""
        now, (last_seen_s, gone) = self._clock(), self._last
        if now - last_seen_s >= STORE_CHECK_EVERY_S:
            gone = self._store.database.replaced()
            self._last = now, gone
        return printable_path(self._store.folder) if gone else ""


def trouble_messages(
    camera: CameraState,
    log: ForceLog | None,
    unfit: str,
    watching: str,
    *,
    store_gone: str = "",
    notices: Sequence[str] = (),
) -> tuple[str, ...]:
    """Messages of problems, the most urgent first.

    ``unfit`` says why the calibration is inactive, ``watching`` why frames cannot be analysed, and ``store_gone`` where
    the store was; each is empty without that problem. ``log`` is the gauge in use, if any. ``notices`` come last.
    """
    messages = []
    if store_gone:
        messages.append(
            f"The store in {store_gone} was moved or replaced since it was opened, and nothing can be kept: "
            "put it back, or start anew."
        )
    if camera.lost:
        why = f": {camera.failure}" if camera.failure else ""
        messages.append(f"The camera is away{why}. Reconnecting; saved data are safe.")
    gauge = None if log is None else log.state()
    if gauge is not None and not gauge.running:
        messages.append(f"The gauge is away: {gauge.error or 'its readings stopped'}.")
    if unfit:
        messages.append(f"The calibration is inactive, and presses are saved without one: {unfit}.")
    if watching:
        messages.append(f"The press cannot be judged: {watching}.")
    return (*messages, *filter(None, notices))
