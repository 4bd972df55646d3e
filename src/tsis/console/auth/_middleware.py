"""Authentication of every request, security headers, limits of size, and of open WebSockets."""

from __future__ import annotations

import asyncio
import logging
import secrets
from contextlib import suppress
from http import HTTPStatus
from typing import TYPE_CHECKING
from urllib.parse import parse_qs, quote, urlencode

from starlette.responses import RedirectResponse

from tsis.console.auth._access import (
    CLIENT,
    ClientIdentity,
    headers_of,
    is_known,
    is_own_origin,
    is_plain_path,
    is_repeated,
    name_of,
    without_forwarded,
)
from tsis.console.auth._login_routes import (
    FAILED,
    KEY_NEEDED,
    LOGIN,
    LOGIN_PATHS,
    AuthRoutes,
    local_address,
    onward,
    refusal,
)

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Collection, Mapping

    from starlette.responses import Response
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

    from tsis.console.auth._access import Access
    from tsis.console.auth._rate_limit import LoginRateLimiter


HTML = b"text/html"


def with_nonce(send: Send, nonce: str) -> Send:
    """Send pages with ``nonce`` on each of their scripts; anything else as it is.

    The pages' templates contain ``<script`` for scripts alone: text from elsewhere reaches them escaped.
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


YEAR_S = 365 * 86400


def safe_headers(nonce: str) -> dict[str, str]:
    """Headers of every response; scripts in a page run only with this page's nonce.

    The library that builds the pages compiles its templates in the browser, hence ``unsafe-eval``, and sets styles on
    elements, hence ``unsafe-inline`` for styles.
    """
    policy = (
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
    return {
        "content-security-policy": "; ".join(policy),
        "x-content-type-options": "nosniff",
        "x-frame-options": "DENY",
        "referrer-policy": "same-origin",  # without it forms would not say from which page they were sent
        "cross-origin-opener-policy": "same-origin",
        "cross-origin-resource-policy": "same-origin",
        "permissions-policy": "camera=(), microphone=(), geolocation=(), usb=(), serial=(), payment=()",
    }


def with_safe_headers(send: Send, nonce: str, *, tls: bool, host: str) -> Send:
    """Add the security headers to responses, in place of others of their names.

    Over TLS browsers are told to use nothing else, unless the console is called ``localhost``, where they would apply
    it to every program of this machine. A response without its own caching rule is not cached, so that nothing is left
    in a browser after logout.
    """
    own = safe_headers(nonce)
    if tls and name_of(host) != "localhost":
        own["strict-transport-security"] = f"max-age={YEAR_S}"

    async def guarded(message: Message) -> None:
        if message["type"] in ("http.response.start", "websocket.http.response.start"):
            added = {name.encode(): value.encode() for name, value in own.items()}
            saved = [(name, value) for name, value in message.get("headers", []) if name.lower() not in added]
            names = {name.lower() for name, _ in saved}
            if b"cache-control" not in names:
                saved.append((b"cache-control", b"no-cache" if b"etag" in names else b"no-store"))
            message["headers"] = [*saved, *added.items()]
        await send(message)

    return guarded


LARGEST_BYTES = 32 * 2**20


class CappedBody:
    """The body of a request up to ``most`` bytes; a larger one reads as a disconnection.

    What the application answers after that is not sent: the middleware answers itself.
    """

    def __init__(self, receive: Receive, send: Send, *, most: int = LARGEST_BYTES) -> None:
        self._receive, self._send, self._left = receive, send, most
        self.too_large = False
        self.response_started = False

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
        if self.too_large and not self.response_started:
            return
        self.response_started = True
        await self._send(message)


def announced_bytes(headers: Mapping[str, str]) -> int:
    """How long the body says it is; 0 when it says nothing."""
    length = headers.get("content-length", "")
    return int(length[:20]) if length.isascii() and length.isdecimal() else 0


DENIAL = "websocket.http.response"  # what servers call the way to refuse a WebSocket with an answer
TOO_LARGE = f"A request may have at most {LARGEST_BYTES >> 20} MiB."
_log = logging.getLogger(__name__)


class AuthMiddleware:
    """ASGI application that passes authenticated requests to ``inner``.

    ``hosts`` are the names, without port, by which this console may be called; ``tries`` limits the rate of logins.
    """

    def __init__(
        self, inner: ASGIApp, *, access: Access, hosts: Collection[str], tries: LoginRateLimiter | None = None
    ) -> None:
        self._inner, self._access, self._hosts = inner, access, frozenset(name.lower() for name in hosts)
        self._auth_routes, self._sockets = AuthRoutes(access, tries=tries), OpenSockets()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuse, let in, or pass on."""
        if scope["type"] == "lifespan":
            watch = asyncio.create_task(self._sockets.watch())
            try:
                await self._inner(scope, receive, send)
            finally:
                watch.cancel()
            return
        nonce = secrets.token_urlsafe(16)
        headers = headers_of(scope)
        safe = with_safe_headers(send, nonce, tls=self._access.secure, host=headers.get("host", ""))
        result = await self._identify(scope, receive, headers)
        if not isinstance(result, ClientIdentity):
            await _refuse(result, scope, receive, safe)
        elif scope["type"] == "websocket":
            await self._pass_socket(_marked(scope, result), receive, send, headers)
        else:
            await self._pass(_marked(scope, result), receive, with_nonce(safe, nonce), safe)

    async def _identify(self, scope: Scope, receive: Receive, headers: Mapping[str, str]) -> ClientIdentity | Response:
        """Who may pass, or what is answered instead."""
        if is_repeated(scope) or not is_plain_path(scope["path"]):
            return refusal("The request is malformed.", HTTPStatus.BAD_REQUEST, requested=headers)
        local = (scope.get("server") or ("",))[0]
        if not is_known(headers.get("host", ""), names=self._hosts, local=local):
            message = "The console does not accept this host name (tsis console --allow-host NAME adds one)."
            return refusal(message, HTTPStatus.MISDIRECTED_REQUEST, requested=headers)
        if not is_own_origin(scope, headers):
            return refusal("Requests from other sites are refused.", HTTPStatus.FORBIDDEN, requested=headers)
        if announced_bytes(headers) > LARGEST_BYTES:
            return refusal(TOO_LARGE, HTTPStatus.REQUEST_ENTITY_TOO_LARGE, requested=headers)
        if scope["type"] == "http" and scope["path"] in LOGIN_PATHS:
            return await self._auth_routes.respond(scope, receive, headers)
        client = self._access.client_identity(headers)
        given, address = _key_and_rest(scope)
        opens = scope["type"] == "http" and scope["method"] == "GET"
        if opens and given and self._access.is_token(given):  # who is in already shall not keep the key on display
            others = {"set-cookie": self._access.cookie()} if client is None else {}
            return onward(address, requested=headers, others=others)
        if client is None:
            return self._refused(opens, address, headers)
        if scope["type"] == "websocket" and self._sockets.full:
            return refusal("Too many pages are open.", HTTPStatus.SERVICE_UNAVAILABLE, requested=headers)
        return client

    def _refused(self, opens: bool, address: str, headers: Mapping[str, str]) -> Response:
        """Redirect a browser to the login page, and refuse other clients."""
        if opens and self._access.logins is not None and "text/html" in headers.get("accept", ""):
            return RedirectResponse(f"{LOGIN}?{urlencode({'then': address})}", HTTPStatus.SEE_OTHER)
        needed = {"www-authenticate": "Bearer"}
        return refusal(KEY_NEEDED, HTTPStatus.UNAUTHORIZED, requested=headers, others=needed)

    async def _pass(self, scope: Scope, receive: Receive, send: Send, reference: Send) -> None:
        body = CappedBody(receive, send)
        try:
            await self._inner(scope, body.receive, body.send)
        except Exception:
            if not body.too_large:
                _log.exception("%s %s failed", scope["method"], scope["path"])
        if not body.response_started:
            large = body.too_large
            message, status = (TOO_LARGE, 413) if large else (FAILED, 500)
            await refusal(message, HTTPStatus(status), requested=headers_of(scope))(scope, receive, reference)

    async def _pass_socket(self, scope: Scope, receive: Receive, send: Send, headers: Mapping[str, str]) -> None:
        def stays() -> bool:
            return self._access.client_identity(headers) is not None

        try:
            cut = await self._sockets.serve(self._inner(scope, receive, send), stays=stays)
        except Exception:
            _log.exception("WebSocket %s failed", scope["path"])
            cut = True
        if cut:
            with suppress(Exception):  # it may be closed already, in several ways
                await send({"type": "websocket.close", "code": POLICY_VIOLATION})


def _key_and_rest(scope: Scope) -> tuple[str, str]:
    """The key in an address, if any, and the address without it."""
    query = parse_qs(scope.get("query_string", b"").decode("latin-1"))
    given = query.pop("token", [""])[0]
    rest = urlencode(query, doseq=True)
    return given, local_address(quote(scope["path"]) + (f"?{rest}" if rest else ""))


def _marked(scope: Scope, client_identity: ClientIdentity) -> Scope:
    """The scope of the application behind the authentication."""
    state = {**scope.get("state", {}), CLIENT: client_identity}
    return {**scope, "headers": without_forwarded(scope["headers"]), "state": state}


async def _refuse(response: Response, scope: Scope, receive: Receive, send: Send) -> None:
    if scope["type"] == "http" or DENIAL in scope.get("extensions", {}):
        await response(scope, receive, send)
    else:
        await send({"type": "websocket.close", "code": POLICY_VIOLATION})


MOST = 64  # eight open pages of four tablets
CHECK_EVERY_S = 2.0
POLICY_VIOLATION = 1008  # code by which a WebSocket is closed


class OpenSockets:
    """Counts WebSockets, at most ``most`` at once, and cancels those of sessions that are over."""

    def __init__(self, *, most: int = MOST) -> None:
        self._most = most
        self._open: dict[asyncio.Task[object], Callable[[], bool]] = {}
        self._cut: set[asyncio.Task[object]] = set()

    @property
    def full(self) -> bool:
        """Whether no more may be opened."""
        return len(self._open) >= self._most

    async def serve(self, served: Awaitable[None], *, stays: Callable[[], bool]) -> bool:
        """Serve a WebSocket in the present task until it ends or is cancelled; whether it was cancelled.

        ``stays`` says whether its client is still authenticated.
        """
        task = asyncio.current_task()
        assert task is not None
        self._open[task] = stays
        try:
            await served
        except asyncio.CancelledError:
            if task not in self._cut:
                raise
            task.uncancel()
            return True
        finally:
            self._open.pop(task, None)
            self._cut.discard(task)
        return False

    def check(self) -> None:
        """Cancel those whose client is not authenticated any more, or cannot be checked."""
        for task, stays in list(self._open.items()):
            if task in self._cut:
                continue
            try:
                over = not stays()
            except Exception:  # the check of the other sockets goes on
                _log.exception("a WebSocket is closed, for it cannot be found out whether it may stay open")
                over = True
            if over:
                self._cut.add(task)
                task.cancel()

    async def watch(self) -> None:
        """Check at intervals, until cancelled."""
        with suppress(asyncio.CancelledError):
            while True:
                await asyncio.sleep(CHECK_EVERY_S)
                self.check()
