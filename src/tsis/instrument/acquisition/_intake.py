"""Counts of a camera's frames: received, missed, disordered, and interruptions."""

from __future__ import annotations

import threading
import time
from collections import deque
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from tsis.errors import CameraError, ImageMismatchError
from tsis.instrument.acquisition._ring import ReceivedFrame
from tsis.model.require import require_number

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.instrument._camera import Frame
    from tsis.instrument.acquisition._ring import FrameRing


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
