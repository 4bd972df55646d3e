"""Acquisition of a camera's frames in threads: each is received or counted as missed.

A `FrameRing` keeps the newest frames, an `Intake` counts them, and an `Acquisition` reads a camera into both and
reconnects it when it is lost.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self

from tsis.errors import CameraError, ImageMismatchError, TsisError
from tsis.instrument.camera import LATE_FRAMES, named_mode
from tsis.model.require import require_integer, require_number

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from types import TracebackType

    from tsis.instrument.camera import Camera, Frame, Mode, Setting


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReceivedFrame:
    """A frame with its arrival on this computer.

    Parameters
    ----------
    frame
        The frame; its ``sequence`` starts from 0 in each connection.
    arrived_s
        Arrival time, seconds on this computer's monotonic clock, which force readings use too.
    connection
        Number of earlier connections.
    """

    frame: Frame
    arrived_s: float
    connection: int = 0

    def __post_init__(self) -> None:
        require_number("arrived_s", self.arrived_s, -1e15, 1e15, hint="seconds")
        require_integer("connection", self.connection, 0, 2**31)


LARGEST_RING = 100_000
MOST_BYTES = 2**30


class FrameRing:
    """Ring of the newest frames; a slow reader learns how many frames were overwritten.

    Safe for several threads.

    Parameters
    ----------
    capacity
        Largest number of frames, in [1, 100000]. 64 frames of 768 x 492 at 8 bits take 24 MB.
    most_bytes
        Largest size of the pixels in bytes; at least one frame is stored.
    patient
        Whether stored frames wait for their single reader instead of being overwritten.
    """

    def __init__(self, capacity: int = 64, *, patient: bool = False, most_bytes: int = MOST_BYTES) -> None:
        self.patient = patient
        self.capacity = require_integer("capacity", capacity, 1, LARGEST_RING, hint="frames")
        self._most_bytes = require_integer("most_bytes", most_bytes, 1, 2**40)
        self._stored: deque[ReceivedFrame] = deque()
        self._bytes = 0
        self._put = self._read_to = 0
        self._closed = False
        self._changed = threading.Condition()

    @property
    def end(self) -> int:
        """Number of frames ever put in: the index of the next one."""
        with self._changed:
            return self._put

    @property
    def closed(self) -> bool:
        """True when no frame will be added any more."""
        return self._closed

    def has_room(self) -> bool:
        """Whether a frame can be added without overwriting an unread one; always true of an impatient ring."""
        unread = self._put - self._read_to
        return not self.patient or unread == 0 or (unread < self.capacity and self._bytes < self._most_bytes)

    def wait_for_room(self, timeout_s: float) -> bool:
        """Wait until there is room or the time is over."""
        with self._changed:
            return self._changed.wait_for(self.has_room, timeout_s)

    def put(self, frame: ReceivedFrame) -> None:
        """Add a frame and wake waiting readers."""
        with self._changed:
            self._stored.append(frame)
            self._bytes += frame.frame.nbytes
            while len(self._stored) > self.capacity or (len(self._stored) > 1 and self._bytes > self._most_bytes):
                self._bytes -= self._stored.popleft().frame.nbytes
            self._put += 1
            self._changed.notify_all()

    def close(self) -> None:
        """Declare the end of the stream, and wake waiting readers."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    def latest(self) -> ReceivedFrame | None:
        """The newest frame; None before the first."""
        with self._changed:
            return self._stored[-1] if self._stored else None

    def wait(self, index: int, timeout_s: float) -> bool:
        """Wait for a frame at or after ``index``, for the end or for the timeout; True for a frame."""
        with self._changed:
            self._changed.wait_for(lambda: self._put > index or self._closed, timeout_s)
            return self._put > index

    def read(self, index: int) -> tuple[tuple[ReceivedFrame, ...], int, int]:
        """Read all frames from ``index`` on.

        Returns
        -------
        The frames in order, the index to read from next, and the number of overwritten frames.
        """
        with self._changed:
            oldest = self._put - len(self._stored)
            skipped = max(0, oldest - index)
            fresh = tuple(self._stored)[max(0, index - oldest) :]
            self._read_to = self._put
            self._changed.notify_all()
            return fresh, self._put, skipped


@dataclass(frozen=True, slots=True, kw_only=True)
class Interruption:
    """An unintended time without frames.

    Attributes
    ----------
    after_frames
        Frames received before it.
    at_s
        Time of the last frame before it, or of the start of the stream, seconds of the monotonic clock.
    noticed_after_s
        Delay of its detection.
    reason
        Message.
    back_after_s
        Time from ``at_s`` until frames arrived again; None before that.
    """

    after_frames: int
    at_s: float
    noticed_after_s: float
    reason: str
    back_after_s: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Account:
    """Counts of the frames: every frame of the camera is either received or missed.

    Attributes
    ----------
    received
        Complete frames.
    missed
        Frames without complete arrival, from the gaps in the camera's numbers.
    disordered
        Frames whose number did not ascend; they are dropped and not counted as received.
    connections
        Number of connections that started to stream.
    frames_per_s
        Rate of arrival in the last two seconds.
    interruptions
        Times without frames.
    """

    received: int
    missed: int
    disordered: int
    connections: int
    frames_per_s: float
    interruptions: tuple[Interruption, ...]


class FrameRate:
    """Rate over the last seconds, from arrival times; never the nominal one.

    Parameters
    ----------
    window_s
        Length of the window, s, in [0.01, 3600].

    Examples
    --------
    >>> rate = FrameRate()
    >>> for number in range(60):
    ...     rate.add(number / 30)
    >>> round(rate.per_s(59 / 30), 6)
    30.0
    >>> rate.per_s(4.0)  # two seconds without frames
    0.0
    """

    def __init__(self, window_s: float = 2.0) -> None:
        self._window_s = require_number("window_s", window_s, 0.01, 3600.0, hint="seconds")
        self._times_s: deque[float] = deque()

    def add(self, time_s: float) -> None:
        """Add the arrival time of a frame."""
        self._times_s.append(time_s)
        self._forget(time_s)

    def per_s(self, now_s: float) -> float:
        """Frames per second in the window that ends now; 0 with fewer than two frames."""
        self._forget(now_s)
        if len(self._times_s) < 2:
            return 0.0
        intervals = len(self._times_s) - 1
        spanned = self._times_s[-1] - self._times_s[0]
        # An overdue frame reduces the rate before the window forgets the last frames.
        overdue = now_s - self._times_s[-1]
        waited = overdue if overdue > 2 * spanned / intervals else 0.0
        return intervals / (spanned + waited) if spanned + waited > 0 else 0.0

    def _forget(self, now_s: float) -> None:
        while self._times_s and now_s - self._times_s[0] > self._window_s:
            self._times_s.popleft()


MOST_INTERRUPTIONS = 1000  # of a loose plug over a day; the number of connections has no limit


class Intake:
    """Takes frames from one connection at a time; frames of an abandoned connection are dropped.

    It starts no thread and never waits, so it works with any clock. Safe for several threads.

    Parameters
    ----------
    ring
        Destination of the frames.
    clock
        Seconds, monotonic.
    """

    def __init__(self, ring: FrameRing, *, clock: Callable[[], float] = time.monotonic) -> None:
        self._ring, self._clock = ring, clock
        self._lock = threading.Lock()
        self._rate = FrameRate()
        self._received = self._missed = self._disordered = self._connections = 0
        self._interruptions: list[Interruption] = []
        self._connection: int | None = None
        self._sequence = -1
        self._heard_s = clock()
        self._shape: tuple[tuple[int, ...], float] | None = None
        self.failure: Exception | None = None

    @property
    def streaming(self) -> bool:
        """True while a connection may deliver frames."""
        return self._connection is not None

    @property
    def any_of_this(self) -> bool:
        """True when the present connection has delivered a frame."""
        return self._sequence >= 0

    def silent_s(self) -> float:
        """Time since the last frame or the start of the stream."""
        return self._clock() - self._heard_s

    @property
    def connection(self) -> int | None:
        """The present connection, if any."""
        return self._connection

    def begin(self, connection: int) -> bool:
        """Take frames from this connection only; False when another connection streams already."""
        with self._lock:
            if self._connection is not None:
                return False
            self._connection, self._sequence = connection, -1
            self._connections += 1
            self._heard_s = self._clock()
            return True

    def take(self, connection: int, frame: Frame) -> bool:
        """Count a frame and put it into the ring; False when its connection was abandoned.

        Raises `ImageMismatchError` when its size or full scale differs from the first frame.
        """
        now_s = self._clock()
        with self._lock:
            if connection != self._connection:
                return False
            self._require_same_format(frame)
            if frame.sequence <= self._sequence:
                self._disordered += 1
                return True
            self._missed += frame.sequence - self._sequence - 1
            if self._interruptions and self._interruptions[-1].back_after_s is None:
                last = self._interruptions[-1]
                self._interruptions[-1] = replace(last, back_after_s=now_s - last.at_s)
            self._received += 1
            self._sequence, self._heard_s = frame.sequence, now_s
            self._rate.add(now_s)
            self._ring.put(ReceivedFrame(frame=frame, arrived_s=now_s, connection=connection))
        return True

    def interrupt(self, connection: int, failure: Exception) -> bool:
        """Abandon a connection; False when it was abandoned before."""
        with self._lock:
            if connection != self._connection:
                return False
            self._connection, self.failure = None, failure
            gone = Interruption(
                after_frames=self._received,
                at_s=self._heard_s,
                noticed_after_s=self._clock() - self._heard_s,
                reason=str(failure),
            )
            self._interruptions = [*self._interruptions[-MOST_INTERRUPTIONS + 1 :], gone]
            return True

    def finish(self, connection: int) -> bool:
        """End the connection of a source without further frames; False when it was abandoned before."""
        with self._lock:
            if connection != self._connection:
                return False
            self._connection = None
            return True

    def account(self) -> Account:
        """Counts of the frames so far."""
        with self._lock:
            return Account(
                received=self._received,
                missed=self._missed,
                disordered=self._disordered,
                connections=self._connections,
                frames_per_s=self._rate.per_s(self._clock()),
                interruptions=tuple(self._interruptions),
            )

    def _require_same_format(self, frame: Frame) -> None:
        present = (frame.pixels.shape, frame.full_scale)
        if self._shape is None:
            self._shape = present
        elif present != self._shape:
            raise ImageMismatchError(
                f"frames of one stream must have one format; the first had {_described(*self._shape)}, "
                f"frame {frame.sequence} has {_described(*present)} (did another program change the camera's mode?)"
            )


def silence(seconds: float) -> CameraError:
    """The error of a camera without frames."""
    return CameraError(f"no frame came for {seconds:.1f} s; check the camera's cable and power")


def _described(shape: tuple[int, ...], full_scale: float) -> str:
    return f"{shape[1]} x {shape[0]} pixels and full scale {full_scale:g}"


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
    >>> from tsis.instrument.drivers.files import ImageFiles
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
