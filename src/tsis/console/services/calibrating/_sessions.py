"""The calibration sessions of a workspace, and what takes the frames of their steps."""

from __future__ import annotations

import threading
from collections import OrderedDict
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING
from weakref import WeakValueDictionary

import numpy as np

from tsis.calibration.force import loading_forces
from tsis.calibration.session import PAD_FORCES_N, LiveCalibration, SessionFolder, saved_calibration
from tsis.catalog.probes import load_probe
from tsis.console.services.calibrating._session import CalibrationRig, CalibrationSession
from tsis.errors import CalibrationError, CameraError, InputError, TsisError
from tsis.imaging import Sensor
from tsis.model.require import require_number
from tsis.virtual.calibration_bench import VirtualBench, bench_seed
from tsis.virtual.loading_machine import PROBE_PAD_SD, tissue_calibration
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from tsis.calibration.file import ProbeCalibration
    from tsis.calibration.session import CalibrationFrame, CalibrationStep, SessionSetup
    from tsis.console.services._camera import CameraController
    from tsis.console.services._control import ControlLock
    from tsis.console.services._jobs import Jobs
    from tsis.instrument.acquisition import Acquisition
    from tsis.instrument.gauge import ForceLog


LONGEST_FOLDER = 60
IDLE = 4  # idle sessions that stay in memory with their results


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionSummary:
    """A session in a list."""

    name: str  # of its folder
    title: str = ""  # title, probe and camera are empty where the terms cannot be read
    probe: str = ""
    camera: str = ""
    done: int = 0  # steps
    total: int = 0
    made: bool = False  # whether a calibration was computed from its frames
    trouble: str = ""  # why it cannot go on; empty where it can


class CalibrationSessions:
    """The sessions in a folder; safe for several threads.

    The last opened ones stay in memory, and all with running work or unsaved presses; others as long as a page shows
    them.
    """

    def __init__(
        self,
        folder: Path,
        *,
        control: ControlLock,
        jobs: Jobs,
        camera_controller: CameraController,
        gauge: Callable[[], ForceLog | None],
    ) -> None:
        self._folder, self._control, self._jobs, self._camera, self._gauge = (
            folder,
            control,
            jobs,
            camera_controller,
            gauge,
        )
        self._lock = threading.Lock()
        self._sessions: OrderedDict[str, CalibrationSession] = OrderedDict()
        self._opened: WeakValueDictionary[str, CalibrationSession] = WeakValueDictionary()

    def listed(self) -> tuple[SessionSummary, ...]:
        """Every session, in the order of names; one that is damaged says so."""
        return tuple(_summary(SessionFolder(path)) for path in self._folders())

    def begin(self, terms: SessionSetup, *, by: str) -> CalibrationSession:
        """Begin a session; its folder is named after it.

        ``terms.camera`` is the name of a virtual rig with its seed, or anything else for the running camera, whose
        name and settings are read. Raises `ControlError` when somebody else has the camera, `CameraError` when it does
        not run, `InputError` or `FileInputError` when such a session exists already or it cannot be written.
        """
        self._control.require(by)
        folder = SessionFolder(self._folder / folder_name(terms.name))
        if folder.path.exists():
            raise InputError(
                f"name must be new; a session in {folder.path.name!r} exists already "
                "(go on with it, or choose another)",
                name="name",
            )
        folder.begin(self._virtual(terms) if bench_seed(terms.camera) is not None else self._with_camera(terms))
        return self.open(folder.path.name)

    def open(self, name: str) -> CalibrationSession:
        """The session in the folder of that name, as it was left; errors as `SessionFolder.terms`."""
        with self._lock:
            session = self._opened.get(name)
            if session is None or not session.folder.begun:
                session = self._read(name)
            self._sessions[name] = self._opened[name] = session
            self._sessions.move_to_end(name)
            self._release()
            return session

    def _folders(self) -> list[Path]:
        """Those that hold a session, in the order of names."""
        try:
            return sorted(path for path in self._folder.iterdir() if SessionFolder(path).begun)
        except OSError:  # none was begun yet
            return []

    def _read(self, name: str) -> CalibrationSession:
        if name not in (path.name for path in self._folders()):
            raise InputError(f"a calibration session must be one of the list; got {name!r:.80} (begin it first)")
        folder = SessionFolder(self._folder / name)
        return CalibrationSession(folder, rig=self._rig(folder), control=self._control, jobs=self._jobs)

    def _release(self) -> None:
        for name in [name for name, session in self._sessions.items() if session.idle][:-IDLE]:
            del self._sessions[name]

    def _rig(self, folder: SessionFolder) -> CalibrationRig:
        terms = folder.terms()
        seed = bench_seed(terms.camera)
        if seed is None:
            return CameraRig(terms, self._camera, self._gauge)
        return VirtualCalibrationRig(terms, seed, before=sum(folder.done(step) for step in folder.plan()))

    def _virtual(self, terms: SessionSetup) -> SessionSetup:
        rig = virtual_bench(terms, np.random.default_rng(0))
        return replace(terms, patch_px=rig.patch_px, settings=rig.settings, pad_sd=PROBE_PAD_SD)

    def _with_camera(self, terms: SessionSetup) -> SessionSetup:
        acquisition = self._camera.acquisition
        if acquisition is None or acquisition.lost:
            raise CameraError("the camera must run when a session begins, which remembers its settings (start it)")
        settings = {setting.name: setting.value for setting in acquisition.settings()}
        began = datetime.now(UTC).replace(microsecond=0)
        return replace(terms, camera=acquisition.name, settings=settings, began=began)


def folder_name(title: str) -> str:
    """A folder for a session of that name: letters, digits, points and lines alone.

    Examples
    --------
    >>> folder_name("May, bench 2/left"), folder_name("../..")
    ('May-bench-2-left', 'session')
    """
    saved = "".join(letter if letter.isascii() and (letter.isalnum() or letter in "._") else " " for letter in title)
    return "-".join(saved.split()).strip("._-")[:LONGEST_FOLDER] or "session"


def _summary(folder: SessionFolder) -> SessionSummary:
    try:
        terms, plan = folder.terms(), folder.plan()
    except TsisError as error:
        return SessionSummary(name=folder.path.name, trouble=str(error))
    return SessionSummary(
        name=folder.path.name,
        title=terms.name,
        probe=terms.probe,
        camera=terms.camera,
        done=sum(folder.done(step) for step in plan),
        total=len(plan),
        made=saved_calibration(folder) is not None,
    )


def virtual_bench(terms: SessionSetup, rng: np.random.Generator) -> VirtualBench:
    """The virtual rig of a session: that of the virtual probe of its seed."""
    rig = VirtualProbe(load_probe(terms.probe), rng=np.random.default_rng(bench_seed(terms.camera)), strain="small")
    return VirtualBench.of(rig, rng=rng, pitch_mm=terms.pitch_mm)


LARGEST_TYPED_N = 100.0
FAR = 2**64  # more random numbers than any step draws


class VirtualCalibrationRig:
    """The virtual rig of a session, created when it is first needed.

    ``before`` steps were done when the program began: the noise of their frames does not repeat.
    """

    by_itself, has_gauge = True, True

    def __init__(self, terms: SessionSetup, seed: int, *, before: int = 0) -> None:
        self._terms, self._seed, self._before = terms, seed, before
        self._rig: VirtualBench | None = None

    def require(self) -> None:
        """Nothing: it is the session's own."""

    def frames(self, step: CalibrationStep) -> int:
        """As the step says, and of a loading all its forces."""
        return step.frames or len(loading_forces() if step.pad_kpa is None else PAD_FORCES_N)

    def shots(self, step: CalibrationStep, over: Callable[[], bool]) -> Iterator[CalibrationFrame]:
        """Yield a step's frames."""
        if self._rig is None:
            source = np.random.PCG64([self._seed, 1])  # the probe itself has its seed
            self._rig = virtual_bench(self._terms, np.random.Generator(source))
            source.advance(self._before * FAR)
        return self._rig.shots(step)

    def finished(self, measured: ProbeCalibration) -> ProbeCalibration:
        """The calibration at the exposure of the virtual probe, on which it is used."""
        return tissue_calibration(measured, Sensor())

    def frame(self, force_n: float) -> CalibrationFrame:
        """Never: it loads by itself."""
        raise CalibrationError("the virtual bench loads by itself; no force is typed (take the step)")


class CameraRig:
    """The camera, and its gauge where there is one."""

    by_itself = False

    def __init__(
        self, terms: SessionSetup, camera_controller: CameraController, gauge: Callable[[], ForceLog | None]
    ) -> None:
        self._terms, self._camera, self._gauge = terms, camera_controller, gauge

    @property
    def has_gauge(self) -> bool:
        """Whether a gauge reads forces."""
        return self._gauge() is not None

    def require(self) -> None:
        """Refuse another camera, or other settings; errors as `acquisition_of`."""
        self._acquisition()

    def frames(self, step: CalibrationStep) -> int:
        """As the step says."""
        return step.frames

    def shots(self, step: CalibrationStep, over: Callable[[], bool]) -> Iterator[CalibrationFrame]:
        """Yield fresh frames, all of one uninterrupted stream at the session's settings."""
        acquisition = self._acquisition()
        before = len(acquisition.account().interruptions)
        instrument = LiveCalibration(acquisition, self._gauge())
        for shot in instrument.loading(over) if step.is_loading else instrument.still(step.frames):
            yield shot
            if len(acquisition.account().interruptions) != before:
                raise CameraError(f"{acquisition.name} was lost meanwhile (wait until it is back)")
        self._acquisition()  # the settings may have been changed elsewhere

    def frame(self, force_n: float) -> CalibrationFrame:
        """The next frame with a typed force, in [-100, 100] N."""
        require_number("force", force_n, -LARGEST_TYPED_N, LARGEST_TYPED_N, hint="newtons")
        return LiveCalibration(self._acquisition()).take_frame(force_n)

    def finished(self, measured: ProbeCalibration) -> ProbeCalibration:
        """The calibration as it was measured."""
        return measured

    def _acquisition(self) -> Acquisition:
        return acquisition_of(self._camera, self._terms)


def acquisition_of(camera_controller: CameraController, terms: SessionSetup) -> Acquisition:
    """The running camera of a session, at the session's settings.

    Raises `CameraError` when it is stopped or away, and `CalibrationError` for another camera or setting.
    """
    acquisition = camera_controller.acquisition
    if acquisition is None:
        raise CameraError(f"the camera {terms.camera!r} must run for this; it is stopped (start it)")
    if acquisition.lost or acquisition.ended:
        raise CameraError(f"{acquisition.name} is away (wait until it is back)")
    if acquisition.name != terms.camera:
        raise CalibrationError(
            f"the camera must be that of the session, {terms.camera!r}; it is {acquisition.name!r} (choose it again)"
        )
    if changed := terms.changed_setting({setting.name: setting.value for setting in acquisition.settings()}):
        setting, value, now = changed
        raise CalibrationError(
            f"the camera must be set as when the session began, {setting} = {value:g}; it is at {now:g} (set it back)"
        )
    return acquisition
