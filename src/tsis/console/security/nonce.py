"""Marks the scripts that stand in the console's own pages, so that browsers run them and no others."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from starlette.types import Message, Send

HTML = b"text/html"


def with_nonce(send: Send, nonce: str) -> Send:
    """Send pages with ``nonce`` on each of their scripts; anything else as it is.

    The pages' templates hold ``<script`` for scripts alone: text from elsewhere reaches them escaped.
    """
    start: Message | None = None
    parts: list[bytes] = []

    async def marked(message: Message) -> None:
        nonlocal start
        if message["type"] == "http.response.start" and _is_page(message):
            start = message
        elif start is not None and message["type"] == "http.response.body":
            parts.append(message.get("body", b""))
            if not message.get("more_body", False):
                body = b"".join(parts).replace(b"<script", b'<script nonce="%s"' % nonce.encode())
                start["headers"] = [
                    (name, str(len(body)).encode() if name.lower() == b"content-length" else value)
                    for name, value in start["headers"]
                ]
                await send(start)
                await send({"type": "http.response.body", "body": body})
        else:
            await send(message)

    return marked


def _is_page(message: Message) -> bool:
    headers = {name.lower(): value for name, value in message.get("headers", [])}
    return headers.get(b"content-type", b"").startswith(HTML) and b"content-encoding" not in headers
