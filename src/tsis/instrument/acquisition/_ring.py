"""A frame, and when it came."""

from __future__ import annotations

import threading
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.model import require_integer, require_number

if TYPE_CHECKING:
    from tsis.instrument._camera import Frame


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReceivedFrame:
    """A frame as it reached this computer.

    Parameters
    ----------
    frame
        The frame; its ``sequence`` counts from 0 anew in each connection.
    arrived_s
        When it came, seconds on this computer's monotonic clock, which force readings share.
    connection
        How often the camera had been connected anew before, from 0.
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
    """Holds the newest frames; the oldest give way, and a reader that was too slow is told how many it missed.

    Safe for several threads.

    Parameters
    ----------
    capacity
        Frames held, in [1, 100000]. 64 frames of 768 x 492 at 8 bits take 24 MB.
    most_bytes
        Bytes of pixels held; of frames that take more, fewer are held, and one at least.
    patient
        Whether stored frames wait until their one reader has room for them, instead of giving way.
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
        """How many frames were ever put in: the place of the next one, where a reader starts to follow."""
        with self._changed:
            return self._put

    @property
    def closed(self) -> bool:
        """True when no frame will be added any more."""
        return self._closed

    def has_room(self) -> bool:
        """Whether a frame can be put in without one that was not read giving way; always true of an impatient ring."""
        unread = self._put - self._read_to
        return not self.patient or unread == 0 or (unread < self.capacity and self._bytes < self._most_bytes)

    def wait_for_room(self, timeout_s: float) -> bool:
        """Wait until there is room or the time is over."""
        with self._changed:
            return self._changed.wait_for(self.has_room, timeout_s)

    def put(self, frame: ReceivedFrame) -> None:
        """Add a frame and wake who waits for it."""
        with self._changed:
            self._stored.append(frame)
            self._bytes += frame.frame.pixels.nbytes
            while len(self._stored) > self.capacity or (len(self._stored) > 1 and self._bytes > self._most_bytes):
                self._bytes -= self._stored.popleft().frame.pixels.nbytes
            self._put += 1
            self._changed.notify_all()

    def close(self) -> None:
        """Say that no frame will be added any more, and wake who waits."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    def latest(self) -> ReceivedFrame | None:
        """The newest frame; None before the first."""
        with self._changed:
            return self._stored[-1] if self._stored else None

    def wait(self, index: int, timeout_s: float) -> bool:
        """Wait until a frame lies at or after ``index``, the ring is closed or the time is over; True for a frame."""
        with self._changed:
            self._changed.wait_for(lambda: self._put > index or self._closed, timeout_s)
            return self._put > index

    def read(self, index: int) -> tuple[tuple[ReceivedFrame, ...], int, int]:
        """Read everything from ``index`` on.

        Returns
        -------
        The frames in order, the place to read from next, and how many frames had given way before they were read.
        """
        with self._changed:
            oldest = self._put - len(self._stored)
            skipped = max(0, oldest - index)
            fresh = tuple(self._stored)[max(0, index - oldest) :]
            self._read_to = self._put
            self._changed.notify_all()
            return fresh, self._put, skipped
