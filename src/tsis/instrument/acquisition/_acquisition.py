"""Acquisition of frames in a thread, with reconnection of a lost camera."""

from __future__ import annotations

import threading
import time
from contextlib import suppress
from typing import TYPE_CHECKING, Self

from tsis.errors import CameraError, TsisError
from tsis.instrument._camera import LATE_FRAMES, named_mode
from tsis.instrument.acquisition._intake import Intake, silence
from tsis.instrument.acquisition._ring import FrameRing
from tsis.model.require import require_number

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from types import TracebackType

    from tsis.instrument._camera import Camera, Mode, Setting
    from tsis.instrument.acquisition._intake import Account
    from tsis.instrument.acquisition._ring import ReceivedFrame


LOST_AFTER_S = 0.8  # with the watch's steps a loss is noticed within a second
WATCH_STEP_S = 0.1
OVERSLEPT_S = 3 * WATCH_STEP_S  # between two checks: the computer was busy, and the camera perhaps not silent
FIRST_FRAME_S = 5.0  # cameras need time to start
OPEN_S = 10.0  # time limit for a driver that opens a camera
STOP_S = 2.0  # time limit for a driver that stops
MOST_STUCK = 3  # threads inside drivers that do not return


class Acquisition:
    """Reads a camera in the background until it is stopped, and reconnects a lost camera.

    One thread per connection makes all calls into the driver, because drivers of unplugged cameras may never return:
    such a thread is abandoned, and a new thread opens a new camera.

    Parameters
    ----------
    connect
        Returns a camera, not yet opened; called again after each loss, since old handles deliver no more frames.
    mode
        Label of the mode; the default mode when None.
    settings
        Settings to apply before each start, by name.
    ring_frames
        Capacity of the ring.
    patient
        Whether frames wait for their single reader instead of being overwritten; for stored frames.
    lost_after_s
        Silence after which the camera counts as lost, s, in [0.05, 3600]; three frames of a slower camera.
    retry_s
        Time between attempts to reconnect, s.
    reconnect
        Whether to reconnect at all.
    clock
        Seconds, monotonic.

    Examples
    --------
    >>> from tsis.instrument.drivers import ImageFiles
    >>> with Acquisition(lambda: ImageFiles("pictures")) as acquisition:  # doctest: +SKIP
    ...     acquisition.ring.wait(0, 1.0)
    ...     acquisition.latest().frame.pixels.shape
    (492, 768)
    """

    def __init__(
        self,
        connect: Callable[[], Camera],
        *,
        mode: str | None = None,
        settings: Mapping[str, float] | None = None,
        ring_frames: int = 64,
        patient: bool = False,
        lost_after_s: float = LOST_AFTER_S,
        retry_s: float = 0.5,
        reconnect: bool = True,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.ring = FrameRing(ring_frames, patient=patient)
        self._connect, self._mode, self._requested = connect, mode, dict(settings or {})
        self._lost_after_s = require_number("lost_after_s", lost_after_s, 0.05, 3600.0, hint="seconds")
        self._retry_s = require_number("retry_s", retry_s, 0.0, 3600.0, hint="seconds")
        self._reconnect, self._clock = reconnect, clock
        self._intake = Intake(self.ring, clock=clock)
        self._camera: Camera | None = None
        self._name = ""
        self._modes: tuple[Mode, ...] = ()
        self._running_mode: Mode | None = None
        self._stopping, self._ended, self._news = threading.Event(), threading.Event(), threading.Event()
        self._readers: list[threading.Thread] = []
        self._watch: threading.Thread | None = None
        self._begun, self._begun_s = 0, 0.0
        self._awake_s = clock()  # since then the watch has checked at every step

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    @property
    def name(self) -> str:
        """The camera's name."""
        return self._name

    @property
    def mode(self) -> Mode | None:
        """The mode of the frames; None before the camera was started."""
        return self._running_mode

    @property
    def modes(self) -> tuple[Mode, ...]:
        """The modes of the camera; none before it was started."""
        return self._modes

    @property
    def lost(self) -> bool:
        """True while no frames arrive or no connection exists."""
        return not self._intake.streaming and not self._ended.is_set() and not self._stopping.is_set()

    @property
    def connection(self) -> int | None:
        """The present connection, as `ReceivedFrame.connection`; None while the camera is lost."""
        return self._intake.connection

    @property
    def ended(self) -> bool:
        """True when stored frames have ended, or a lost camera is not to be reconnected."""
        return self._ended.is_set()

    @property
    def failure(self) -> Exception | None:
        """Reason of the last interruption, if any."""
        return self._intake.failure

    def start(self) -> None:
        """Connect and begin.

        Raises
        ------
        TsisError
            The camera's error, when it cannot be opened or started.
        CameraError
            When it does not answer.
        """
        if self._watch is not None:
            raise CameraError(f"the acquisition of {self._name} runs already; stop it first")
        self._begin_reader()
        if not self._news.wait(OPEN_S):
            self.stop()
            raise CameraError(f"the camera did not open within {OPEN_S:g} s; check its cable and power")
        failure = self._intake.failure
        if failure is not None and self._intake.account().connections == 0:
            self.stop()
            raise failure
        self._watch = threading.Thread(target=self._watch_over, name="camera watch", daemon=True)
        self._watch.start()

    def stop(self) -> None:
        """End the stream; frames in the ring stay. Another call does nothing."""
        self._stopping.set()
        self._let_go()
        for thread in (self._watch, *self._readers):
            if thread is not None and thread.is_alive():
                thread.join(timeout=STOP_S)
        self.ring.close()

    def latest(self) -> ReceivedFrame | None:
        """The newest frame; None before the first."""
        return self.ring.latest()

    def account(self) -> Account:
        """Counts of the frames so far."""
        return self._intake.account()

    def settings(self) -> tuple[Setting, ...]:
        """The adjustable settings; none when stored frames have ended."""
        return () if self.ended else self._present().settings()

    def adjust(self, name: str, value: float) -> None:
        """Change a setting now, and again after each reconnection.

        Raises
        ------
        UnknownNameError, InputError, CameraError
            The camera's error.
        """
        self._present().adjust(name, value)
        self._requested[name] = value

    def _present(self) -> Camera:
        if self._camera is None or not self._intake.streaming:
            raise CameraError(f"{self._name or 'the camera'} is not connected; wait until it is back")
        return self._camera

    def _begin_reader(self) -> None:
        number, self._begun = self._begun, self._begun + 1
        self._begun_s = self._clock()
        reader = threading.Thread(target=self._read, args=(number,), name=f"camera {number}", daemon=True)
        self._readers = [thread for thread in self._readers if thread.is_alive()] + [reader]
        reader.start()

    def _read(self, number: int) -> None:
        """Run one connection."""
        camera: Camera | None = None
        try:
            camera = self._connect()
            camera.open()
            self._prepare(camera)
            if self._stopping.is_set() or not self._intake.begin(number):  # another connection was faster
                return
            self._camera, self._name = camera, camera.name
            self._news.set()
            for frame in camera.frames():
                if not self._room() or not self._intake.take(number, frame):
                    return
            if self._intake.finish(number):
                self._end()
        except TsisError as error:
            self._fail(number, error)
        except Exception as error:  # a driver may raise anything
            self._fail(number, CameraError(f"the camera's driver failed: {type(error).__name__}: {error}"))
        finally:
            if camera is not None:
                _stop_quietly(camera)
            self._news.set()

    def _room(self) -> bool:
        """Wait until the ring has room; False when the acquisition is stopped."""
        while not self._stopping.is_set():
            if self.ring.wait_for_room(WATCH_STEP_S):
                return True
        return False

    def _prepare(self, camera: Camera) -> None:
        for name, value in self._requested.items():
            camera.adjust(name, value)
        self._modes = camera.modes()
        self._running_mode = self._modes[0] if self._mode is None else named_mode(self._modes, self._mode)
        camera.start(None if self._mode is None else self._running_mode)

    def _end(self) -> None:
        self._ended.set()
        self.ring.close()

    def _let_go(self) -> None:
        """Stop the camera in a thread of its own: drivers of lost cameras may not return."""
        camera = self._camera
        if camera is not None:
            thread = threading.Thread(target=_stop_quietly, args=(camera,), name="camera stop", daemon=True)
            thread.start()
            thread.join(timeout=0.0 if self.lost else STOP_S)

    def _fail(self, number: int, error: Exception) -> None:
        if not self._intake.interrupt(number, error):
            self._intake.failure = error  # before the stream started

    def _watch_over(self) -> None:
        tried_s = checked_s = self._clock()
        while not self._stopping.wait(WATCH_STEP_S) and not self._ended.is_set():
            before_s, checked_s = checked_s, self._clock()
            if checked_s - before_s > OVERSLEPT_S:
                self._awake_s = checked_s
            if self._intake.streaming:
                self._require_sound()
                tried_s = self._clock()
            elif not self._reconnect:
                self._end()
            elif self._clock() - tried_s >= self._retry_s and self._free():
                tried_s = self._clock()
                self._begin_reader()

    def _require_sound(self) -> None:
        if self.ring.patient:  # stored frames wait for their reader, so silence is no loss
            return
        silent_s, connection = self._intake.silent_s(), self._intake.connection
        heard_nothing_s = min(silent_s, self._clock() - self._awake_s)
        if connection is None or heard_nothing_s <= self._timeout_s():
            return
        if self._intake.interrupt(connection, silence(silent_s)):
            self._let_go()

    def _timeout_s(self) -> float:
        rate = None if self._running_mode is None else self._running_mode.frames_per_s
        slow = LATE_FRAMES / rate if rate else 0.0
        first = 0.0 if self._intake.any_of_this else FIRST_FRAME_S
        return max(self._lost_after_s, slow, first)

    def _free(self) -> bool:
        """Whether another connection may be tried: none is opening, or the newest takes too long."""
        alive = [thread for thread in self._readers if thread.is_alive()]
        return not alive or (len(alive) < MOST_STUCK and self._clock() - self._begun_s > OPEN_S)


def _stop_quietly(camera: Camera) -> None:
    with suppress(Exception):  # errors of a lost camera change nothing
        camera.stop()
