"""The camera of a console: opened, started, adjusted and lost."""

from __future__ import annotations

import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from typing import TYPE_CHECKING, Any

from tsis.calibration.guard.watch import guard_reference
from tsis.catalog.sensors import load_sensor
from tsis.console.services.choice import VirtualSubject
from tsis.console.services.jobs import RUNNING
from tsis.errors import CalibrationError, CameraError, ControlError, InputError, TsisError
from tsis.instrument.acquisition import LOST_AFTER_S, Acquisition
from tsis.instrument.camera import LATE_FRAMES, preset
from tsis.instrument.discovery import connect, find_cameras
from tsis.model.require import require_number, require_one_of
from tsis.virtual.calibration_bench import bench_seed
from tsis.virtual.camera import FORCE_SETTING, LARGEST_FORCE_N, VirtualGelCamera, virtual_gel_sensor

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.calibration.frames import UsableCalibration
    from tsis.calibration.guard.reading import GuardReference
    from tsis.console.services.choice import CameraChoice
    from tsis.console.services.jobs import Job, Jobs, JobState
    from tsis.console.worker import WorkerProcess
    from tsis.instrument.acquisition import ReceivedFrame
    from tsis.instrument.camera import Camera, Setting
    from tsis.instrument.discovery import CameraListing


Pair = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ActiveCalibration:
    """Result of one check; its parts belong to the same camera settings."""

    calibration: UsableCalibration | None
    why: str  # why there is none; empty where none is requested
    scale: Pair | None  # size (x, y) of a pixel on the face, mm
    probe: str  # of the virtual probe, of the calibration, or as chosen with the camera
    reference: GuardReference  # of the press guard

    @property
    def compared(self) -> tuple[GuardReference, Pair | None]:
        """Reference of the watched frames, and their scale."""
        return self.reference, self.scale

    def sidecar_entries(self) -> dict[str, Any]:
        """Probe and calibration, for the files beside frames."""
        return {"probe": self.probe, "calibration": None if self.calibration is None else self.calibration.citation()}


class ActiveCalibrationCheck:
    """Checks a calibration against the running camera: it is inactive while a setting such as the exposure differs.

    Without a chosen calibration the virtual probe's own is checked, if any.
    """

    def __init__(self, camera_controller: CameraController, given: UsableCalibration | None) -> None:
        self._camera, self.chosen = camera_controller, given
        self._checked: tuple[UsableCalibration | None, VirtualSubject | None, GuardReference] | None = None

    def use(self, given: UsableCalibration | None) -> None:
        """Choose another one, or None; `CalibrationError` when it does not fit, and the one before stays."""
        if given is not None:
            _require_fit(given, self._camera)
        self.chosen = given

    def now(self) -> ActiveCalibration:
        """Check once with the camera's present settings."""
        subject, choice = self._camera.subject, self._camera.choice
        given, why = self._check(self.chosen or (None if subject is None else subject.calibration))
        measured = None if given is None else given.calibration.scale
        scale = None if subject is None else subject.mm_per_pixel
        return ActiveCalibration(
            calibration=given,
            why=why,
            scale=scale if measured is None else measured.mm_per_pixel,
            probe=choice.probe if choice.is_virtual or given is None else given.calibration.probe or choice.probe,
            reference=self._reference(given, subject),
        )

    def _check(self, calibration: UsableCalibration | None) -> tuple[UsableCalibration | None, str]:
        if calibration is None:
            return None, ""
        try:
            _require_fit(calibration, self._camera)
        except CalibrationError as error:
            return None, str(error)
        return calibration, ""

    def _reference(
        self, calibration: UsableCalibration | None, virtual_subject: VirtualSubject | None
    ) -> GuardReference:
        checked = self._checked
        if checked is None or checked[0] is not calibration or checked[1] is not virtual_subject:
            own = virtual_subject is not None and calibration is virtual_subject.calibration
            created = (
                virtual_subject.guard_reference()
                if virtual_subject is not None and own
                else guard_reference(calibration)
            )
            self._checked = checked = calibration, virtual_subject, created
        return checked[2]


def _require_fit(cited: UsableCalibration, camera_controller: CameraController) -> None:
    """Refuse, with `CalibrationError`, what is expired, or of another probe, camera, setting or size of frames."""
    calibration, choice, acquisition = cited.calibration, camera_controller.choice, camera_controller.acquisition
    seed = bench_seed(calibration.camera)
    if seed is not None and not calibration.settings:
        raise CalibrationError(
            f"calibration {calibration.name!r} is of the {calibration.camera}, an exercise: no page looks "
            "through its camera "
            "(begin a new calibration, which is one of the virtual probe)"
        )
    if seed is not None and (not choice.is_virtual or choice.is_sphere or choice.seed != seed):
        raise CalibrationError(
            f"calibration {calibration.name!r} is of the virtual probe of seed {seed} on tissue; the camera is "
            f"{_of(choice)} (choose that probe on the page Camera, or begin a calibration of this one)"
        )
    calibration.require_usable(
        datetime.now(UTC),
        probe=choice.probe if choice.is_virtual else None,
        camera=acquisition.name if acquisition is not None and not choice.is_virtual else None,
        settings={setting.name: setting.value for setting in camera_controller.settings()},
    )
    latest = None if acquisition is None else acquisition.latest()
    if latest is None:
        return
    shape, full_scale = latest.frame.pixels.shape, latest.frame.full_scale
    scale, reference = calibration.scale, calibration.reference
    if scale is not None and scale.shape != shape:
        raise _other_frames(calibration.name, scale.shape, shape)
    if reference is not None and reference.untouched_grey.shape != shape:
        raise _other_frames(calibration.name, reference.untouched_grey.shape, shape)
    if reference is not None and reference.full_scale != full_scale:
        raise CalibrationError(
            f"calibration {calibration.name!r} is of frames with full scale {reference.full_scale:g}; the camera's "
            f"have {full_scale:g} (start the camera in the mode in which it was calibrated)"
        )


def _of(choice: CameraChoice) -> str:
    if not choice.is_virtual:
        return choice.spec
    return f"the virtual probe of seed {choice.seed} on {'a bare sphere' if choice.is_sphere else 'tissue'}"


def _other_frames(name: str, ours: tuple[int, ...], theirs: tuple[int, ...]) -> CalibrationError:
    return CalibrationError(
        f"calibration {name!r} is of frames of {ours[1]} x {ours[0]} pixels; the camera's have "
        f"{theirs[1]} x {theirs[0]} (start the camera in the mode in which it was calibrated)"
    )


EVERY_S = 1.0
LOCK_TIMEOUT_S = 1.0  # for which a reading waits for another one, which may be stuck in a driver


class SettingsCache:
    """Caches the camera's settings, read in a thread every ``every_s`` seconds: drivers are slow.

    Settings may also change elsewhere; ``changed`` is called then. The force of the virtual probe is left out: no
    camera has such a setting.
    """

    def __init__(
        self, acquisition: Callable[[], Acquisition | None], changed: Callable[[], None], *, every_s: float = EVERY_S
    ) -> None:
        self._acquisition, self._changed, self._every_s = acquisition, changed, every_s
        self._lock = threading.Lock()
        self._last: tuple[Acquisition | None, tuple[Setting, ...]] = (None, ())
        self._values: dict[str, float] = {}
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="settings of the camera", daemon=True)
        self._thread.start()

    def now(self) -> tuple[Setting, ...]:
        """What can be adjusted; empty while the camera is stopped or away. It never waits."""
        acquisition = self._acquisition()
        of, settings = self._last
        return settings if acquisition is not None and acquisition is of and not acquisition.lost else ()

    def refresh(self) -> None:
        """Ask the camera now."""
        if not self._lock.acquire(timeout=LOCK_TIMEOUT_S):
            return
        try:
            acquisition = self._acquisition()
            if acquisition is None or acquisition.lost:
                return
            settings = tuple(setting for setting in acquisition.settings() if setting.name != FORCE_SETTING)
            values = {setting.name: setting.value for setting in settings}
            differ = acquisition is self._last[0] and values != self._values
            self._last, self._values = (acquisition, settings), values
        except TsisError:  # it went this moment
            return
        finally:
            self._lock.release()
        if differ:
            self._changed()

    def close(self) -> None:
        """End the thread; one that is stuck in a driver is left behind."""
        self._closing.set()
        self._thread.join(timeout=1.0)

    def _run(self) -> None:
        while not self._closing.wait(self._every_s):
            self.refresh()


FRESH_S = 5.0  # within which a frame must come, or within some frames of a slow camera
# Frames after a change that may be of before it: of the virtual camera the one under way; of others those that wait
# in camera and driver too, and of exposures that cameras change one or two frames later.
UNDER_WAY, IN_CAMERAS = 1, 3
MOST_TYPED_N = 1000.0
VIRTUAL_LOST_AFTER_S = 60.0  # the virtual probe is never unplugged: its silence is a busy computer's


class CameraController:
    """Controls one camera at a time, and knows what is pressed.

    Commands come one at a time (`Commands`); meanwhile everything can be read, and `close` called, from any thread.
    Nothing is connected before `start`. ``changed`` is called after a change of a setting, here or elsewhere.

    Attributes
    ----------
    choice
        Which camera.
    subject
        The virtual probe; None before its first start and for other cameras.
    acquisition
        The running camera; None while it is stopped.
    role, force_n
        What is pressed, and how hard: of the virtual probe or as typed, None where unknown.
    solver
        Process that solves the virtual probe's presses, whose frames then come from a process of their own, too. None:
        both is done here.
    """

    def __init__(
        self,
        choice: CameraChoice,
        *,
        changed: Callable[[], None] = lambda: None,
        connect_to: Callable[[str], Camera] = connect,
    ) -> None:
        self.choice, self.role, self.force_n = choice, choice.roles[0], choice.touch_n
        self.subject: VirtualSubject | None = None
        self.acquisition: Acquisition | None = None
        self.solver: WorkerProcess | None = None
        self._beginning: Acquisition | None = None
        self._ahead: tuple[object, threading.Thread, list[VirtualSubject]] | None = None
        self._connect_to, self._on_change = connect_to, changed
        self._as_it_came: tuple[Setting, ...] = ()
        self._requested: dict[str, float] = {}
        self._change: tuple[Acquisition | None, int, float] = (None, 0, 0.0)
        self._closed = False
        self._settings = SettingsCache(lambda: self.acquisition, self._changed)

    @property
    def running(self) -> bool:
        """Whether the camera was started, though it may be away."""
        return self.acquisition is not None

    @property
    def name(self) -> str:
        """The camera's name; empty while it is stopped."""
        acquisition = self.acquisition
        return "" if acquisition is None else acquisition.name

    def choose(self, choice: CameraChoice) -> None:
        """Let go of the camera, and take another one; it is not yet started."""
        self.stop()
        self.choice, self.subject = choice, None
        self.role, self.force_n = choice.roles[0], choice.touch_n
        self._as_it_came, self._requested = (), {}

    def prepare(self) -> None:
        """Solve the first press of the virtual probe in the background, once, so that `start` need not wait for it."""
        if self.choice.is_virtual and self._ahead is None:
            begins, solved = self._begins, list[VirtualSubject]()

            def solve() -> None:
                with suppress(TsisError, RuntimeError):  # `start` tries again, and says it
                    solved.append(self._pressed(*begins))

            thread = threading.Thread(target=solve, name="first press", daemon=True)
            self._ahead = begins, thread, solved
            thread.start()

    def start(self) -> None:
        """Connect and begin to stream; nothing happens when it runs already. Errors as `Acquisition.start`."""
        if self.acquisition is not None:
            return
        connector = self._connector()
        acquisition = Acquisition(
            connector,
            mode=self.choice.mode,
            settings=self._requested,
            lost_after_s=VIRTUAL_LOST_AFTER_S if self.choice.is_virtual else LOST_AFTER_S,
        )
        self._beginning = acquisition
        try:
            self._require_open()
            acquisition.start()
            self._require_open()
            self.acquisition = acquisition
        except InputError:  # e.g. a setting that this camera does not take: the next start shall not ask for it
            self._requested = {}
            raise
        except ControlError:
            acquisition.stop()
            raise
        finally:
            self._beginning = None
        self._settings.refresh()
        if not self._as_it_came:
            self._as_it_came = self.settings()

    def stop(self) -> None:
        """End the stream; settings are remembered for the next start."""
        acquisition, self.acquisition = self.acquisition, None
        if acquisition is not None:
            acquisition.stop()

    def close(self) -> None:
        """Let go of the camera for good, also of one that is being started."""
        self._closed = True
        beginning = self._beginning
        self.stop()
        if beginning is not None:
            beginning.stop()
        self._settings.close()

    def settings(self) -> tuple[Setting, ...]:
        """What can be adjusted, at most a second old; empty while the camera is stopped or away. It never waits."""
        return self._settings.now()

    def refresh(self) -> None:
        """Ask the camera for its settings now."""
        self._settings.refresh()

    def adjust(self, name: str, value: float) -> None:
        """Change a setting now and after each reconnection; errors as `Acquisition.adjust`."""
        acquisition = self._streaming()
        if present := self.settings():
            require_one_of("setting", name, [item.name for item in present])
        acquisition.adjust(name, value)
        self._requested[name] = float(value)
        self._changed()
        self._settings.refresh()

    def preset(self, name: str) -> None:
        """Make all settings of a preset: as the camera came, or as low as they go."""
        for setting, value in preset(name, self._as_it_came).items():
            self.adjust(setting, value)

    def completed(self, role: str | None, force_n: float | None, *, forget: bool = False) -> tuple[str, float | None]:
        """Role and force in newtons after a change that names only one of them; ``forget`` makes the force unknown.

        Raises `InputError` for a force together with ``forget``, or ``forget`` with the virtual probe.
        """
        if forget and force_n is not None:
            raise InputError(f"force_n must be given or forgotten, not both; got {force_n!r:.40} and forget")
        if forget and self.choice.is_virtual:
            raise InputError("force_n must be a number for the virtual probe, whose force is always known; got none")
        present = None if forget else self.force_n
        return self.role if role is None else role, present if force_n is None else force_n

    def hold(self, role: str, force_n: float | None) -> None:
        """Set what is pressed and how hard, or that the force is unknown; the virtual probe moves there.

        Raises `InputError` for an unknown role or a force outside its range, and `MechanicsError` when the tissue
        cannot be pressed so hard; the press then stays as it was.
        """
        require_one_of("role", role, self.choice.roles)
        if self.choice.is_virtual or force_n is not None:
            most = LARGEST_FORCE_N if self.choice.is_virtual else MOST_TYPED_N
            force_n = require_number("force_n", force_n, 0.0, most, hint="newtons")
        if self.subject is not None and force_n is not None:
            self.subject.hold(role, force_n)
        self.role, self.force_n = role, force_n
        self._mark()

    def fresh(self) -> ReceivedFrame:
        """The newest frame that was begun after the last change.

        Raises `CameraError` when the camera is stopped or away, or delivers none in time.
        """
        acquisition = self._streaming()
        period_s = _period_s(acquisition)
        of, end, change_s = self._change
        skipped = UNDER_WAY if self.choice.is_virtual else IN_CAMERAS
        # Frames that waited for this computer come in one go: not only so many, but so much later.
        position, after_s = (end + skipped, change_s + (skipped - 1) * period_s) if of is acquisition else (0, 0.0)
        timeout_s = max(FRESH_S, 2 * LATE_FRAMES * period_s)
        until_s = time.monotonic() + timeout_s
        while (left_s := until_s - time.monotonic()) > 0:
            if acquisition.lost or acquisition.ring.closed:
                raise CameraError(f"{acquisition.name} is away; nothing was saved (wait until it is back)")
            if not acquisition.ring.wait(position, min(left_s, 0.1)):
                continue
            position, received = acquisition.ring.end, acquisition.latest()
            if received is None or received.connection != acquisition.connection:
                continue  # of before it was lost
            if received.arrived_s >= after_s:
                return received
        raise CameraError(f"{acquisition.name} must bring a frame within {timeout_s:g} s; got none (is it running?)")

    def _changed(self) -> None:
        self._mark()
        self._on_change()

    def _mark(self) -> None:
        """Remember when the last change was, and how many frames had come."""
        acquisition = self.acquisition
        if acquisition is not None:
            self._change = acquisition, acquisition.ring.end, time.monotonic()

    def _streaming(self) -> Acquisition:
        acquisition = self.acquisition
        if acquisition is None:
            raise CameraError("the camera must run for this; it is stopped (start it)")
        return acquisition

    def _require_open(self) -> None:
        if self._closed:
            raise ControlError("the console is shutting down; the camera was not started (start the console again)")

    def _connector(self) -> Callable[[], Camera]:
        if sensor := virtual_gel_sensor(self.choice.spec):
            gel_camera = VirtualGelCamera(load_sensor(sensor), seed=self.choice.seed)
            return lambda: gel_camera  # rendered once
        if not self.choice.is_virtual:
            return partial(self._connect_to, self.choice.spec)
        if self.subject is None:
            # Solved before it streams: a camera that brings no frame for seconds counts as lost.
            self.subject = self._first_press()
        return partial(self.subject.connect, apart=self.solver is not None)

    def _first_press(self) -> VirtualSubject:
        """The virtual probe in its first press, which `prepare` may have solved; given away once."""
        if self._ahead is not None and self._ahead[0] == self._begins:
            _, thread, solved = self._ahead
            thread.join()
            if solved:
                return solved.pop()
        return self._pressed(*self._begins)

    @property
    def _begins(self) -> tuple[CameraChoice, str, float | None]:
        return self.choice, self.role, self.force_n

    def _pressed(self, choice: CameraChoice, role: str, force_n: float | None) -> VirtualSubject:
        """A virtual probe whose press is solved; errors as `hold`."""
        assert force_n is not None
        subject = VirtualSubject(choice, solver=self.solver)
        subject.hold(role, force_n)
        return subject


def _period_s(acquisition: Acquisition) -> float:
    """Seconds from frame to frame as its mode says; 0 where it does not."""
    rate = None if acquisition.mode is None else acquisition.mode.frames_per_s
    return 1.0 / rate if rate else 0.0


SEARCH_TITLE = "search for cameras"


class CameraSearch:
    """Searches as a job; a call during a search returns the running job.

    ``findings`` are those of the last search; None before the first is over.
    """

    def __init__(self, jobs: Jobs) -> None:
        self._jobs, self._lock = jobs, threading.Lock()
        self._job: Job | None = None
        self.findings: CameraListing | None = None

    def state(self) -> JobState | None:
        """State of the running or last search; None before the first."""
        job = self._job
        return None if job is None else job.state()

    def begin(self) -> Job:
        """Begin a search, or join the running one."""
        with self._lock:
            if self._job is None or self._job.state().status != RUNNING:
                self._job = self._jobs.begin(SEARCH_TITLE, self._searched)
            return self._job

    def _searched(self, job: Job) -> CameraListing:
        self.findings = findings = find_cameras()
        number = len(findings.cameras)
        job.say({0: "No camera answered.", 1: "1 camera answered."}.get(number, f"{number} cameras answered."))
        return findings
