"""A ring of received frames with their arrival times."""

from __future__ import annotations

import threading
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.model.require import require_integer, require_number

if TYPE_CHECKING:
    from tsis.instrument._camera import Frame


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
