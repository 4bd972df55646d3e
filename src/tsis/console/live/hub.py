"""Tells every viewer that a new frame is there; who is slow misses frames, and nobody waits for him."""

from __future__ import annotations

import asyncio
import threading
import time
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.console.live.packet import packet, sight_text

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from tsis.console.bench.sight import Sight
    from tsis.instrument.acquisition import Acquisition, ReceivedFrame

WAIT_S = 0.25
REST_S = 0.1  # while no camera runs


@dataclass(frozen=True, slots=True, kw_only=True)
class Newest:
    """The newest frame.

    Attributes
    ----------
    arrival
        The frame, and when it came.
    number
        How many frames had come with it.
    """

    arrival: ReceivedFrame
    number: int


class LiveHub:
    """One thread that waits for frames and wakes the viewers, which live in an event loop.

    Parameters
    ----------
    acquisition
        Gives the running acquisition; None while there is none.
    """

    def __init__(self, acquisition: Callable[[], Acquisition | None]) -> None:
        self._acquisition = acquisition
        self._lock = threading.Lock()
        self._viewers: set[tuple[asyncio.AbstractEventLoop, asyncio.Event]] = set()
        self._latest: Newest | None = None
        self._packed: dict[int | None, tuple[Newest, bytes]] = {}  # by quality
        self._packing: dict[int | None, threading.Lock] = {}
        self._told: tuple[Sight | None, str] = (None, sight_text(None))
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="live view", daemon=True)
        self._thread.start()

    @property
    def latest(self) -> Newest | None:
        """The newest frame; None before the first one of a camera."""
        return self._latest

    @property
    def viewers(self) -> int:
        """How many watch."""
        return len(self._viewers)

    def packed(self, newest: Newest, quality: int | None) -> bytes:
        """A frame as `packet`, made once for all who watch in that quality, whichever threads they ask in."""
        with self._packing.setdefault(quality, threading.Lock()):
            held = self._packed.get(quality)
            if held is not None and held[0] is newest:
                return held[1]
            came_ms = (newest.arrival.arrived_s + time.time() - time.monotonic()) * 1000.0
            made = packet(newest.arrival, number=newest.number, came_ms=came_ms, jpeg_quality=quality)
            self._packed[quality] = newest, made
            return made

    def text(self, sight: Sight | None) -> str:
        """What a frame shows as `sight_text`, made once for all who watch."""
        told = self._told
        if told[0] is not sight:
            self._told = told = sight, sight_text(sight)
        return told[1]

    @contextmanager
    def watched(self) -> Iterator[asyncio.Event]:
        """Watch: the event is set at each new frame. To be entered in the viewer's event loop."""
        event = asyncio.Event()
        with self._lock:
            self._viewers.add((asyncio.get_running_loop(), event))
        if self._latest is not None:
            event.set()
        try:
            yield event
        finally:
            self._leave(event)

    def _leave(self, event: asyncio.Event) -> None:
        with self._lock:
            self._viewers = {each for each in self._viewers if each[1] is not event}
            if not self._viewers:
                self._packed.clear()

    def close(self) -> None:
        """End the thread."""
        self._closing.set()
        self._thread.join(timeout=2.0)

    def _run(self) -> None:
        followed: Acquisition | None = None
        place = 0
        while not self._closing.is_set():
            acquisition = self._acquisition()
            if acquisition is not followed:
                followed, place, self._latest = acquisition, 0, None
            if acquisition is None or (acquisition.ring.closed and acquisition.ring.end <= place):
                self._closing.wait(REST_S)
            elif acquisition.ring.wait(place, WAIT_S):
                place = acquisition.ring.end
                arrival = acquisition.latest()
                if arrival is not None:
                    self._latest = Newest(arrival=arrival, number=place)
                    self._wake()

    def _wake(self) -> None:
        with self._lock:
            viewers = list(self._viewers)
        for loop, event in viewers:
            try:
                loop.call_soon_threadsafe(event.set)
            except RuntimeError:  # its loop has ended
                self._leave(event)
