"""Timeouts of connections that send no request."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from uvicorn.protocols.http.h11_impl import H11Protocol

if TYPE_CHECKING:
    import asyncio

    import h11


SILENCE_S = 10.0
NOT_OPENED = "A WebSocket is asked for by GET, without a body, and with few and short headers."


class TimeoutProtocol(H11Protocol):
    """uvicorn's HTTP protocol with a timeout for connections without a request."""

    silence_s = SILENCE_S

    def __init__(self, *arguments: Any, **named: Any) -> None:
        super().__init__(*arguments, **named)
        self._last_cycle: object = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin to watch a connection."""
        super().connection_made(transport)
        self.loop.call_later(self.silence_s, self._check)

    def handle_websocket_upgrade(self, event: h11.Request) -> None:
        """Answer a request that cannot become a WebSocket: uvicorn sends nothing, and no timeout applies any more."""
        super().handle_websocket_upgrade(event)
        understood = getattr(self.transport.get_protocol(), "handshake_initiated", True)
        if not understood and not self.transport.is_closing():
            self.send_400_response(NOT_OPENED)

    def _check(self) -> None:
        if self not in self.connections:  # it was closed, or has become a WebSocket
            return
        waits = self.cycle is None or self.cycle.response_complete
        if waits and self.cycle is self._last_cycle:  # no whole request since the last check
            self.transport.close()
            return
        self._last_cycle = self.cycle
        self.loop.call_later(self.silence_s, self._check)
