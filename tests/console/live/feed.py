"""Frames that a test brings one by one, where an acquisition would stand."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from tsis.instrument.acquisition import FrameRing, ReceivedFrame
from tsis.instrument.camera import Frame

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Feed:
    """As much of an acquisition as the live view and the watcher use."""

    def __init__(self) -> None:
        self.ring = FrameRing(8)
        self.lost = self.ended = False

    def latest(self) -> ReceivedFrame | None:
        return self.ring.latest()

    def bring(self, pixels: NDArray[Any], *, full_scale: float = 255.0) -> ReceivedFrame:
        """A new frame."""
        now_s = time.monotonic()
        frame = Frame(pixels=pixels, sequence=self.ring.end, time_s=now_s, full_scale=full_scale)
        arrival = ReceivedFrame(frame=frame, arrived_s=now_s)
        self.ring.put(arrival)
        return arrival
