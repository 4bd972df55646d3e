"""The WebSocket of the live view: a frame, its acknowledgement, the next frame."""

from __future__ import annotations

import asyncio
import ipaddress
import logging
from asyncio import to_thread
from contextlib import suppress
from typing import TYPE_CHECKING

from starlette.websockets import WebSocketDisconnect

from tsis.console.live._hub import is_as_shown

if TYPE_CHECKING:
    from starlette.websockets import WebSocket

    from tsis.console.live._hub import LiveHub
    from tsis.console.services import Instrument


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
