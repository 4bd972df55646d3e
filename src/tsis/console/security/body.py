"""Bodies of requests that may not grow without end."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from starlette.types import Message, Receive, Send

LARGEST_BYTES = 32 * 2**20


class CappedBody:
    """The body of a request up to a size; what reads more of it is told that the sender has gone.

    Parameters
    ----------
    receive, send
        Of the request. What is answered after the body was too large is not sent: the gate answers that.
    most
        Bytes.
    """

    def __init__(self, receive: Receive, send: Send, *, most: int = LARGEST_BYTES) -> None:
        self._receive, self._send, self._left = receive, send, most
        self.too_large = False
        self.answered = False

    async def receive(self) -> Message:
        """The next part of the body."""
        if self.too_large:
            return {"type": "http.disconnect"}
        message = await self._receive()
        if message["type"] == "http.request":
            self._left -= len(message.get("body", b""))
            if self._left < 0:
                self.too_large = True
                return {"type": "http.disconnect"}
        return message

    async def send(self, message: Message) -> None:
        """Pass the answer on."""
        if self.too_large and not self.answered:
            return
        self.answered = True
        await self._send(message)


def announced_bytes(headers: Mapping[str, str]) -> int:
    """How long the body says it is; 0 when it says nothing."""
    length = headers.get("content-length", "")
    return int(length[:20]) if length.isascii() and length.isdecimal() else 0
