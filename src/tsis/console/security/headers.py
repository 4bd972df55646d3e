"""Headers that tell browsers what the console's pages may do: nothing but talk to the console itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.console.security.asked import name_of

if TYPE_CHECKING:
    from starlette.types import Message, Send

YEAR_S = 365 * 86400


def policy(nonce: str) -> str:
    """Content security policy: own files, own connections, scripts in a page only with this page's nonce.

    The library that builds the pages compiles its templates in the browser, hence ``unsafe-eval``, and sets styles on
    elements, hence ``unsafe-inline`` for styles.
    """
    return "; ".join(
        (
            "default-src 'self'",
            f"script-src 'self' 'nonce-{nonce}' 'unsafe-eval'",
            "style-src 'self' 'unsafe-inline'",
            "img-src 'self' data: blob:",
            "font-src 'self' data:",
            "connect-src 'self'",
            "object-src 'none'",
            "base-uri 'none'",
            "form-action 'self'",
            "frame-ancestors 'none'",
        )
    )


def safe_headers(nonce: str) -> dict[str, str]:
    """Headers of every answer."""
    return {
        "content-security-policy": policy(nonce),
        "x-content-type-options": "nosniff",
        "x-frame-options": "DENY",
        "referrer-policy": "same-origin",  # without any, forms would not say from which page they were sent
        "cross-origin-opener-policy": "same-origin",
        "cross-origin-resource-policy": "same-origin",
        "permissions-policy": "camera=(), microphone=(), geolocation=(), usb=(), serial=(), payment=()",
    }


def with_safe_headers(send: Send, nonce: str, *, tls: bool, host: str) -> Send:
    """Add the safe headers to answers, in place of others of their names.

    Browsers are told to use nothing but TLS from now on where the console does, unless it is called ``localhost``:
    they would hold every other program of this machine to it too. What says nothing of being kept is not kept, so
    that nothing is left in a browser whose user has logged out.
    """
    own = safe_headers(nonce)
    if tls and name_of(host) != "localhost":
        own["strict-transport-security"] = f"max-age={YEAR_S}"

    async def guarded(message: Message) -> None:
        if message["type"] in ("http.response.start", "websocket.http.response.start"):
            added = {name.encode(): value.encode() for name, value in own.items()}
            kept = [(name, value) for name, value in message.get("headers", []) if name.lower() not in added]
            names = {name.lower() for name, _ in kept}
            if b"cache-control" not in names:
                kept.append((b"cache-control", b"no-cache" if b"etag" in names else b"no-store"))
            message["headers"] = [*kept, *added.items()]
        await send(message)

    return guarded
