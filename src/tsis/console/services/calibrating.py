"""Guided calibrations: sessions, their steps as jobs."""

from __future__ import annotations

import threading
from collections import OrderedDict
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Protocol
from weakref import WeakValueDictionary

import numpy as np

from tsis.calibration.file import calibration_sha256
from tsis.calibration.force_line import loading_forces
from tsis.calibration.session import (
    PAD_FORCES_N,
    LiveCalibration,
    SessionFolder,
    archive_calibration,
    calibrate,
    save_calibration,
    saved_calibration,
)
from tsis.catalog.probes import load_probe
from tsis.console.services.jobs import RUNNING, JobCancelled
from tsis.errors import CalibrationError, CameraError, ControlError, InputError, TsisError
from tsis.imaging.sensor import Sensor
from tsis.model.require import require_integer, require_number, require_one_of
from tsis.virtual.calibration_bench import VirtualBench, bench_seed
from tsis.virtual.loading_machine import PROBE_PAD_SD, tissue_calibration
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence
    from pathlib import Path

    from tsis.calibration.file import ProbeCalibration
    from tsis.calibration.session import CalibrationFrame, CalibrationStep, SessionResult, SessionSetup
    from tsis.console.services.camera import CameraController
    from tsis.console.services.control import ControlLock
    from tsis.console.services.jobs import Job, Jobs
    from tsis.instrument.acquisition import Acquisition
    from tsis.instrument.force_log import ForceLog


OPEN, UNDER_WAY, DONE, LEFT_OUT = "open", "under way", "done", "left out"


class CalibrationRig(Protocol):
    """Takes frames."""

    @property
    def by_itself(self) -> bool:
        """Whether it takes the steps without an operator."""

    @property
    def has_gauge(self) -> bool:
        """Whether forces of a loading are read for it; else a person types each."""

    def require(self) -> None:
        """Refuse frames that do not belong to the session: another camera, other settings, none at all."""

    def frames(self, step: CalibrationStep) -> int:
        """How many frames a step will have; 0 where a person says when it is over."""

    def shots(self, step: CalibrationStep, over: Callable[[], bool]) -> Iterator[CalibrationFrame]:
        """Yield a step's frames; a loading by the gauge until ``over`` says so."""

    def frame(self, force_n: float) -> CalibrationFrame:
        """The next frame, with a force that a person read."""

    def finished(self, measured: ProbeCalibration) -> ProbeCalibration:
        """The calibration as it will be used, from the one that the frames gave."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StepState:
    """A step and its progress."""

    step: CalibrationStep
    status: str  # OPEN, UNDER_WAY, DONE or LEFT_OUT
    frames: int = 0  # saved
    forces_n: tuple[float, ...] = ()  # typed so far in an unfinished loading, newtons


MOST_TYPED = 100  # presses of one loading
MOST_TYPED_BYTES = 2**30  # of the unsaved frames of all typed loadings, which wait in memory


class TypedLoadings:
    """The presses of each loading, by the name of its step; changed by one thread at a time, read by any."""

    def __init__(self, *, most_bytes: int = MOST_TYPED_BYTES) -> None:
        self._most_bytes = most_bytes
        self._shots: dict[str, list[CalibrationFrame]] = {}

    @property
    def is_empty(self) -> bool:
        """Whether nothing is unsaved."""
        return not self._shots

    def shots(self, step: str) -> tuple[CalibrationFrame, ...]:
        """The presses of a step so far, in the order in which they were taken."""
        return tuple(self._shots.get(step, ()))

    def forces_n(self, step: str) -> tuple[float, ...]:
        """Their forces, newtons."""
        return tuple(shot.force_n or 0.0 for shot in self.shots(step))

    def require_room(self, step: str) -> None:
        """Refuse, with `InputError`, a press more than a loading may have."""
        require_integer("presses of a loading", len(self.shots(step)) + 1, 1, MOST_TYPED, hint="save what there is")

    def add(self, step: str, shot: CalibrationFrame) -> int:
        """Add a press, and return how many there are.

        Raises `InputError` for too many, and `CalibrationError` when the frames would take too much memory.
        """
        self.require_room(step)
        stored = sum(shot.image.grey.nbytes for shots in self._shots.values() for shot in shots)
        if stored + shot.image.grey.nbytes > self._most_bytes:
            raise CalibrationError(
                f"presses that are not saved yet may take at most {self._most_bytes / 2**20:.0f} MiB; this one would "
                "take more (keep the loadings that are complete)"
            )
        self._shots.setdefault(step, []).append(shot)
        return len(self._shots[step])

    def forget_last(self, step: str) -> None:
        """Forget the last press of a step; without one nothing happens."""
        shots = self._shots.get(step, [])
        if shots:
            shots.pop()
        if not shots:
            self.forget(step)

    def forget(self, step: str) -> None:
        """Forget a step's presses."""
        self._shots.pop(step, None)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CalibrationResult:
    """A calibration that was made from a session's frames, with what stands behind it.

    ``measured`` is at the exposure of the session; ``saved`` is the one that the rig will use, in ``file``, and
    ``identity`` its hash.
    """

    measured: ProbeCalibration
    saved: ProbeCalibration
    findings: SessionResult
    identity: str
    file: Path


class CalibrationSession:
    """A session; safe for several threads. One step is taken at a time.

    ``job`` is the step that runs or ran last, ``making`` the computation of the calibration; None before. ``result``
    was computed from the present frames while this program runs; its `file` stays longer.
    """

    def __init__(self, folder: SessionFolder, *, rig: CalibrationRig, control: ControlLock, jobs: Jobs) -> None:
        self.folder, self.rig = folder, rig
        self.terms: SessionSetup = folder.setup()
        self._control, self._jobs = control, jobs
        self._plan = folder.plan()
        self._lock = threading.RLock()
        self._over = threading.Event()
        self._left_out: set[str] = set()
        self._taking = ""
        self._typed = TypedLoadings()
        self.job: Job | None = None
        self.making: Job | None = None
        self.result: CalibrationResult | None = None

    @property
    def name(self) -> str:
        """Of its folder."""
        return self.folder.path.name

    @property
    def busy(self) -> bool:
        """Whether a step is being taken, or the calibration made."""
        return any(job is not None and job.state().status == RUNNING for job in (self.job, self.making))

    @property
    def idle(self) -> bool:
        """Whether nothing would be lost with it that is not in its folder, but for what was left out."""
        return self._typed.is_empty and not self.busy

    @property
    def file(self) -> Path | None:
        """The calibration made from the frames as they are; None before."""
        return saved_calibration(self.folder)

    def steps(self) -> tuple[StepState, ...]:
        """How far each step is, in order."""
        taking = self._taking if self.job is not None and self.job.state().status == RUNNING else ""
        return tuple(self._state(step, taking) for step in self._plan)

    def take(self, name: str, *, by: str) -> Job:
        """Take the frames of a step in the background; all of them are saved, or none.

        Raises `ControlError` when another step runs or somebody else has the camera, and `CalibrationError` or
        `CameraError` when the step is done or the camera is not that of the session.
        """
        return self._begin([self._open(name)], by)

    def take_all(self, *, by: str) -> Job:
        """Take every step that is open, one after the other; of rigs that need no operator."""
        if not self.rig.by_itself:
            raise CalibrationError("all steps at once need the virtual bench; a camera needs a person (take each step)")
        steps = [state.step for state in self.steps() if state.status in (OPEN, LEFT_OUT)]
        if not steps:
            raise CalibrationError("every step is done (repeat one, or make the calibration)")
        return self._begin(steps, by)

    def end_loading(self, *, by: str) -> None:
        """Say that a loading by the gauge is back at 0: what was taken is saved."""
        self._control.require(by)
        self._over.set()

    def end_step(self, *, by: str) -> None:
        """End the step that is being taken; none of its frames is saved. Without one nothing happens."""
        self._control.require(by)
        if self.job is not None:
            self.job.end()

    def press(self, name: str, force_n: float, *, by: str) -> int:
        """Take the next frame of a loading at a typed force, and return how many there are now.

        Errors of the force, the camera and the step leave what was typed before as it was.
        """
        step = self._open(name)
        if not step.is_loading:
            raise CalibrationError(f"forces belong to loadings; step {name!r} is none (take its frames)")
        with self._lock:
            self._require(by)
            self._typed.require_room(name)
            return self._typed.add(name, self.rig.frame(force_n))

    def unpress(self, name: str, *, by: str) -> None:
        """Forget the last press of a loading whose forces are typed; without one nothing happens."""
        with self._lock:
            self._require(by)
            self._typed.forget_last(name)

    def save_presses(self, name: str, *, by: str) -> int:
        """Save the typed presses as the step's frames, and return how many."""
        step = self._open(name)
        with self._lock:
            self._require(by)
            shots = self._typed.shots(name)
            if not shots:
                raise CalibrationError("a loading must have presses to be saved; it has none (type the first force)")
            return self._save(step, shots)

    def leave_out(self, name: str, *, by: str) -> None:
        """Leave out a step that a calibration can be made without; taking it later is possible."""
        self._control.require(by)
        if not self._open(name).optional:
            raise CalibrationError(f"step {name!r} cannot be skipped: every calibration needs it")
        self._left_out.add(name)

    def repeat(self, name: str, *, by: str) -> None:
        """Remove the frames of a step, so that it is open again; a calibration made from them is set aside."""
        step = self._step(name)
        with self._lock:
            self._require(by)
            archive_calibration(self.folder)
            self.result = None
            self.folder.forget(step)
            self._left_out.discard(name)

    def make(self, *, days: float) -> Job:
        """Make the calibration in the background and save its file; the job's result is the `CalibrationResult`."""
        require_number("days", days, 1, 3650)

        def work(job: Job) -> CalibrationResult:
            measured, findings = calibrate(self.folder, days=days, progress=job.advance)
            usable = self.rig.finished(measured)
            file = save_calibration(self.folder, usable)
            self.result = CalibrationResult(
                measured=measured, saved=usable, findings=findings, identity=calibration_sha256(usable), file=file
            )
            job.say(f"The calibration is in {file}")
            return self.result

        with self._lock:
            self._require_idle()
            self.making = self._jobs.begin(f"calibration {self.name}", work)
            return self.making

    def _begin(self, steps: Sequence[CalibrationStep], by: str) -> Job:
        with self._lock:
            self._require(by)
            self.rig.require()
            self._over.clear()
            self._taking = steps[0].name
            what = steps[0].name if len(steps) == 1 else f"{len(steps)} steps"
            self.job = self._jobs.begin(
                f"calibration {self.name}: {what}",
                lambda job: self._take(job, steps),
                at_once=not self.rig.by_itself,  # a person stands before the camera and loads
            )
            return self.job

    def _take(self, job: Job, steps: Sequence[CalibrationStep]) -> int:
        total = sum(self.rig.frames(step) for step in steps)
        kept = 0
        for step in steps:
            self._taking = step.name
            try:
                kept += self._save(step, self._reporting(job, step, kept, total))
            except TsisError as error:
                raise CalibrationError(f"step {step.name!r} is not saved, those before it are: {error}") from error
            self._left_out.discard(step.name)
        job.say(f"{kept} frames saved")
        return kept

    def _reporting(self, job: Job, step: CalibrationStep, before: int, total: int) -> Iterator[CalibrationFrame]:
        """The step's frames, with progress; a cancelled job saves nothing of the step."""

        def over() -> bool:
            if job.ending:
                raise JobCancelled
            return self._over.is_set()

        for number, shot in enumerate(self.rig.shots(step, over), start=1):
            job.advance(before + number, total)
            yield shot

    def _save(self, step: CalibrationStep, shots: Iterable[CalibrationFrame]) -> int:
        kept = self.folder.save(step, self._then_archive(shots))
        self._typed.forget(step.name)
        return kept

    def _then_archive(self, shots: Iterable[CalibrationFrame]) -> Iterator[CalibrationFrame]:
        """A step's frames; before the step counts as done, the calibration made from fewer frames is set aside."""
        yield from shots
        archive_calibration(self.folder)
        self.result = None

    def _state(self, step: CalibrationStep, taking: str) -> StepState:
        frames = self.folder.count(step)
        if step.name == taking:
            status = UNDER_WAY
        elif self.folder.done(step):
            status = DONE
        else:
            status = LEFT_OUT if step.name in self._left_out else OPEN
        return StepState(step=step, status=status, frames=frames, forces_n=self._typed.forces_n(step.name))

    def _step(self, name: str) -> CalibrationStep:
        return {step.name: step for step in self._plan}[
            require_one_of("step", name, [step.name for step in self._plan])
        ]

    def _open(self, name: str) -> CalibrationStep:
        step = self._step(name)
        if self.folder.done(step):
            raise CalibrationError(f"step {name!r} is done; its frames are saved (repeat it to take others)")
        return step

    def _require(self, by: str) -> None:
        self._control.require(by)
        self._require_idle()

    def _require_idle(self) -> None:
        if self.busy:
            what = (
                "being made" if self.making is not None and self.making.state().status == RUNNING else "taking a step"
            )
            raise ControlError(f"calibration {self.name!r} is {what}; wait until that is over (or end it)")


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
        terms = folder.setup()
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
    letters = "".join(letter if letter.isascii() and (letter.isalnum() or letter in "._") else " " for letter in title)
    return "-".join(letters.split()).strip("._-")[:LONGEST_FOLDER] or "session"


def _summary(folder: SessionFolder) -> SessionSummary:
    try:
        terms, plan = folder.setup(), folder.plan()
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
