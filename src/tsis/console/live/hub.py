"""The thread and WebSocket that hand frames to all viewers."""

from __future__ import annotations

import asyncio
import ipaddress
import logging
import struct
import threading
import time
from asyncio import to_thread
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import TYPE_CHECKING

import numpy as np
from pydantic import TypeAdapter
from starlette.websockets import WebSocketDisconnect

from tsis.console.services.frames import FrameAnalysis
from tsis.errors import InputError
from tsis.files.images import encode_picture
from tsis.imaging.colour import COLOUR_MAPS, colour_map
from tsis.model.image import TactileImage
from tsis.model.require import require_number, require_one_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from typing import Any

    from numpy.typing import NDArray
    from starlette.websockets import WebSocket

    from tsis.console.services.instrument import Instrument
    from tsis.instrument.acquisition import Acquisition, ReceivedFrame


GREY = "grey"
DIFFERENCE = "difference"  # from blue over white to red, for signs
MAPS = (*COLOUR_MAPS, GREY)
FULL = 255.0
GAMMAS = (0.1, 10.0)
FIRST_MAP = "viridis"


@lru_cache(maxsize=len(MAPS) + 1)
def packed_colours(map_name: str) -> tuple[int, ...]:
    """256 colours as the 32-bit integers of a canvas: red lowest, alpha 255."""
    if map_name == DIFFERENCE:
        ends = np.array([[33, 102, 172], [247, 247, 247], [178, 24, 43]])
        rgb = np.stack([np.interp(np.arange(256), (0, 127.5, 255), part) for part in ends.T], axis=1).round()
        rgb = rgb.astype(np.uint32)
    elif require_one_of("colour map", map_name, MAPS) == GREY:
        rgb = np.repeat(np.arange(256, dtype=np.uint32)[:, None], 3, axis=1)
    else:
        levels = np.arange(256, dtype=float)[None, :]
        rgb = colour_map(TactileImage(grey=levels), name=map_name)[0].astype(np.uint32)
    packed = rgb[:, 0] | rgb[:, 1] << 8 | rgb[:, 2] << 16 | np.uint32(255 << 24)
    return tuple(packed.tolist())


def checked_ends(ends: tuple[float, float], gamma: float) -> list[float]:
    """The two ends of a colour map in levels of 255 and the exponent between them; `InputError` for anything else."""
    low, high = (require_number(name, end, 0.0, FULL) for name, end in zip(("low", "high"), ends, strict=True))
    if high <= low:
        raise InputError(f"high must exceed low = {low:g}; got {high:g}")
    return [low, high, require_number("gamma", gamma, *GAMMAS)]


# magic, encoding, three bytes unused, number of the frame, rows, columns, when it came in ms, full scale, black's level
HEADER = struct.Struct("<4sB3xIHHdff")
MAGIC = b"TSF1"
RAW, PICTURE = 0, 1
BITS_8 = 255.0


def is_as_shown(frame: ReceivedFrame) -> bool:
    """Whether a frame has 255 levels as a screen does, so that `packet` only copies it."""
    return bool(frame.frame.pixels.dtype == np.uint8 and frame.frame.full_scale == BITS_8)


def packet(frame: ReceivedFrame, *, number: int, came_ms: float, jpeg_quality: int | None = None) -> bytes:
    """The newest frame for a viewer, with its number and the time of its arrival in ms since 1970.

    Raw pixels, or a JPEG of a quality in [1, 100].
    """
    levels = display_levels(frame)
    rows, columns = levels.shape
    encoding = RAW if jpeg_quality is None else PICTURE
    header = HEADER.pack(MAGIC, encoding, number % 2**32, rows, columns, came_ms, frame.frame.full_scale, 0.0)
    if jpeg_quality is None:
        return header + levels.tobytes()
    return header + encode_picture(levels, "jpg", quality=jpeg_quality)


def still_packet(image: TactileImage, *, zero: float = 0.0) -> bytes:
    """A single frame in the same form, losslessly; ``zero`` is the grey level that is shown black."""
    levels = shown_levels(image.grey - zero, image.full_scale)
    header = HEADER.pack(MAGIC, PICTURE, 0, *levels.shape, 0.0, image.full_scale, zero)
    return header + encode_picture(levels)


def display_levels(frame: ReceivedFrame) -> NDArray[np.uint8]:
    """Grey levels with 255 at full scale, shape (rows, columns), uint8: a screen shows no more."""
    pixels = np.asarray(frame.frame.pixels)
    return pixels if is_as_shown(frame) else shown_levels(pixels, frame.frame.full_scale)


def shown_levels(pixels: NDArray[Any], full_scale: float) -> NDArray[np.uint8]:
    """Grey levels as `display_levels`, of any kind of number."""
    scaled = np.clip(pixels.astype(np.float32) * (BITS_8 / full_scale), 0.0, BITS_8)
    return np.asarray(np.rint(scaled), dtype=np.uint8)


def analysis_json(frame_analysis: FrameAnalysis | None) -> str:
    """What a frame shows, as JSON; ``null`` stands for what is not finite, and where nothing is known."""
    return _analysis_type().dump_json(frame_analysis).decode()


@cache
def _analysis_type() -> TypeAdapter[FrameAnalysis | None]:
    return TypeAdapter(FrameAnalysis | None)


WAIT_S = 0.25
REST_S = 0.1  # while no camera runs


@dataclass(frozen=True, slots=True, kw_only=True)
class NewestFrame:
    """The newest frame, and how many frames had come with it."""

    received: ReceivedFrame
    number: int


class LiveHub:
    """A thread that waits for frames of the running ``acquisition()`` and notifies the clients in an event loop."""

    def __init__(self, acquisition: Callable[[], Acquisition | None]) -> None:
        self._acquisition = acquisition
        self._lock = threading.Lock()
        self._viewers: set[tuple[asyncio.AbstractEventLoop, asyncio.Event]] = set()
        self.latest: NewestFrame | None = None  # before the first frame of a camera
        self._packed: dict[int | None, tuple[NewestFrame, bytes]] = {}  # by quality
        self._packing: dict[int | None, threading.Lock] = {}
        self._described: tuple[FrameAnalysis | None, str] = (None, analysis_json(None))
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="live view", daemon=True)
        self._thread.start()

    @property
    def viewers(self) -> int:
        """How many watch."""
        return len(self._viewers)

    def packed(self, newest: NewestFrame, quality: int | None) -> bytes:
        """A frame as `packet`, built once for all clients of that quality; safe for several threads."""
        with self._packing.setdefault(quality, threading.Lock()):
            stored = self._packed.get(quality)
            if stored is not None and stored[0] is newest:
                return stored[1]
            came_ms = (newest.received.arrived_s + time.time() - time.monotonic()) * 1000.0
            created = packet(newest.received, number=newest.number, came_ms=came_ms, jpeg_quality=quality)
            self._packed[quality] = newest, created
            return created

    def text(self, frame_analysis: FrameAnalysis | None) -> str:
        """The analysis as `analysis_json`, built once for all clients."""
        last = self._described
        if last[0] is not frame_analysis:
            self._described = last = frame_analysis, analysis_json(frame_analysis)
        return last[1]

    @contextmanager
    def watched(self) -> Iterator[asyncio.Event]:
        """Watch: the event is set at each new frame. To be entered in the viewer's event loop."""
        event = asyncio.Event()
        with self._lock:
            self._viewers.add((asyncio.get_running_loop(), event))
        if self.latest is not None:
            event.set()
        try:
            yield event
        finally:
            self._leave(event)

    def _leave(self, event: asyncio.Event) -> None:
        with self._lock:
            self._viewers = {viewer for viewer in self._viewers if viewer[1] is not event}
            if not self._viewers:
                self._packed.clear()

    def close(self) -> None:
        """End the thread."""
        self._closing.set()
        self._thread.join(timeout=2.0)

    def _run(self) -> None:
        followed: Acquisition | None = None
        position = 0
        while not self._closing.is_set():
            acquisition = self._acquisition()
            if acquisition is not followed:
                followed, position, self.latest = acquisition, 0, None
            if acquisition is None or (acquisition.ring.closed and acquisition.ring.end <= position):
                self._closing.wait(REST_S)
            elif acquisition.ring.wait(position, WAIT_S):
                position = acquisition.ring.end
                received = acquisition.latest()
                if received is not None:
                    self.latest = NewestFrame(received=received, number=position)
                    self._wake()

    def _wake(self) -> None:
        with self._lock:
            viewers = list(self._viewers)
        for loop, event in viewers:
            try:
                loop.call_soon_threadsafe(event.set)
            except RuntimeError:  # its loop has ended
                self._leave(event)


REMOTE_QUALITY = 85  # of JPEG for viewers on other machines
ACKNOWLEDGED_S = 10.0  # without an acknowledgement a viewer counts as gone
TRY_AGAIN, FAILED = 1013, 1011  # codes with which a WebSocket is closed
_log = logging.getLogger(__name__)


async def live_view(
    socket: WebSocket, *, instrument: Instrument, hub: LiveHub, timeout_s: float = ACKNOWLEDGED_S
) -> None:
    """Send the latest frame and its analysis each time that the viewer has drawn the one before.

    ``?jpeg=70`` asks for pictures of that quality, ``?jpeg=0`` for raw pixels; by default viewers on this machine get
    raw pixels and others pictures. Whatever the viewer sends counts as an acknowledgement; without one within
    ``timeout_s`` seconds the socket is closed.
    """
    await socket.accept()
    drawn = asyncio.Event()
    sending = asyncio.create_task(_send(socket, instrument, hub, drawn, timeout_s))
    try:
        while (await socket.receive())["type"] != "websocket.disconnect":
            drawn.set()
    finally:
        sending.cancel()
        await asyncio.gather(sending, return_exceptions=True)


async def _send(
    socket: WebSocket, instrument: Instrument, hub: LiveHub, drawn: asyncio.Event, timeout_s: float
) -> None:
    """Send frames until the viewer is gone or too slow."""
    code = TRY_AGAIN
    try:
        with hub.watched() as news:
            await _send_frames(socket, instrument, hub, news, drawn, timeout_s)
    except (WebSocketDisconnect, RuntimeError):  # it went while something was being sent
        return
    except TimeoutError:
        pass
    except Exception:
        _log.exception("the live view failed")
        code = FAILED
    with suppress(RuntimeError):
        await socket.close(code)


async def _send_frames(
    socket: WebSocket, instrument: Instrument, hub: LiveHub, news: asyncio.Event, drawn: asyncio.Event, timeout_s: float
) -> None:
    quality, last = _quality(socket), None
    while True:
        await news.wait()
        news.clear()
        newest, analysis = hub.latest, instrument.frame_analysis
        if newest is None:
            continue
        if analysis is not last:
            last = analysis
            await socket.send_text(hub.text(analysis))
        at_once = quality is None and is_as_shown(newest.received)
        packed = hub.packed(newest, quality) if at_once else await to_thread(hub.packed, newest, quality)
        drawn.clear()
        await socket.send_bytes(packed)
        async with asyncio.timeout(timeout_s):  # wait_for may lose a cancellation that comes with what it waits for
            await drawn.wait()


def _quality(socket: WebSocket) -> int | None:
    quality = socket.query_params.get("jpeg", "")
    if quality.isdecimal() and len(quality) <= 3:
        return min(int(quality), 100) or None
    return None if is_here(socket) else REMOTE_QUALITY


def is_here(socket: WebSocket) -> bool:
    """Whether the viewer is on this machine."""
    try:
        return socket.client is not None and ipaddress.ip_address(socket.client.host).is_loopback
    except ValueError:
        return False
