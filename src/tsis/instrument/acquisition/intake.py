"""Where frames come in: each is checked against the one before, counted, and put into the ring."""

from __future__ import annotations

import threading
import time
from dataclasses import replace
from typing import TYPE_CHECKING

from tsis.instrument.acquisition.account import Account, Interruption
from tsis.instrument.acquisition.arrival import ReceivedFrame
from tsis.instrument.acquisition.frame_rate import FrameRate
from tsis.model.errors import CameraError, ImageMismatchError

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.instrument.acquisition.ring import FrameRing
    from tsis.instrument.camera import Frame

KEPT_INTERRUPTIONS = 1000  # of a loose plug over a day; the number of connections goes on counting


class Intake:
    """Takes frames from one connection at a time; what an abandoned one still brings is turned away.

    It starts no thread and never waits, so that it runs on any clock. Safe for several threads.

    Parameters
    ----------
    ring
        Where frames go.
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
        """True while a connection may bring frames."""
        return self._connection is not None

    @property
    def any_of_this(self) -> bool:
        """True when the present connection has brought a frame."""
        return self._sequence >= 0

    def silent_s(self) -> float:
        """How long ago the last frame came, or the stream began."""
        return self._clock() - self._heard_s

    @property
    def connection(self) -> int | None:
        """The connection that frames are taken from; None while there is none."""
        return self._connection

    def begin(self, connection: int) -> bool:
        """Take frames from this connection and no other from now on; False when another brings frames already."""
        with self._lock:
            if self._connection is not None:
                return False
            self._connection, self._sequence = connection, -1
            self._connections += 1
            self._heard_s = self._clock()
            return True

    def take(self, connection: int, frame: Frame) -> bool:
        """Count a frame and put it into the ring; False when its connection was given up.

        Raises
        ------
        ImageMismatchError
            When its size or full scale is not that of the first frame.
        """
        now_s = self._clock()
        with self._lock:
            if connection != self._connection:
                return False
            self._require_alike(frame)
            if frame.sequence <= self._sequence:
                self._disordered += 1
                return True
            self._missed += frame.sequence - self._sequence - 1
            self._note_return(now_s)
            self._received += 1
            self._sequence, self._heard_s = frame.sequence, now_s
            self._rate.add(now_s)
            self._ring.put(ReceivedFrame(frame=frame, arrived_s=now_s, connection=connection))
        return True

    def interrupt(self, connection: int, failure: Exception) -> bool:
        """Give up a connection; False when it had been given up before."""
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
            self._interruptions = [*self._interruptions[-KEPT_INTERRUPTIONS + 1 :], gone]
            return True

    def finish(self, connection: int) -> bool:
        """The source has no more frames, as its nature is; False when its connection had been given up before."""
        with self._lock:
            if connection != self._connection:
                return False
            self._connection = None
            return True

    def account(self) -> Account:
        """What became of the frames so far."""
        with self._lock:
            return Account(
                received=self._received,
                missed=self._missed,
                disordered=self._disordered,
                connections=self._connections,
                frames_per_s=self._rate.per_s(self._clock()),
                interruptions=tuple(self._interruptions),
            )

    def _require_alike(self, frame: Frame) -> None:
        found = (frame.pixels.shape, frame.full_scale)
        if self._shape is None:
            self._shape = found
        elif found != self._shape:
            raise ImageMismatchError(
                f"frames of one stream must be alike; the first had {_described(*self._shape)}, "
                f"frame {frame.sequence} has {_described(*found)} (did another program change the camera's mode?)"
            )

    def _note_return(self, now_s: float) -> None:
        if self._interruptions and self._interruptions[-1].back_after_s is None:
            last = self._interruptions[-1]
            self._interruptions[-1] = replace(last, back_after_s=now_s - last.at_s)


def silence(seconds: float) -> CameraError:
    """What is said of a camera whose frames stay away."""
    return CameraError(f"no frame came for {seconds:.1f} s; check the camera's cable and power")


def _described(shape: tuple[int, ...], full_scale: float) -> str:
    return f"{shape[1]} x {shape[0]} pixels and full scale {full_scale:g}"
