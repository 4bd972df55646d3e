"""The gate before every page, call and WebSocket: known hosts, own origins, and nobody who was not let in."""

from __future__ import annotations

import asyncio
import logging
import secrets
from contextlib import suppress
from http import HTTPStatus
from typing import TYPE_CHECKING
from urllib.parse import parse_qs, quote, urlencode

from starlette.responses import RedirectResponse

from tsis.console.security.asked import (
    headers_of,
    is_known,
    is_own_origin,
    is_plain_path,
    is_repeated,
    without_forwarded,
)
from tsis.console.security.body import LARGEST_BYTES, CappedBody, announced_bytes
from tsis.console.security.desk import PLACES, Desk
from tsis.console.security.door import FAILED, KEY_NEEDED, LOGIN, local_address, onward, refusal
from tsis.console.security.headers import with_safe_headers
from tsis.console.security.nonce import with_nonce
from tsis.console.security.sockets import POLICY_VIOLATION, OpenSockets
from tsis.console.security.visitor import VISITOR, Visitor

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from starlette.responses import Response
    from starlette.types import ASGIApp, Receive, Scope, Send

    from tsis.console.security.access import Access
    from tsis.console.security.attempts import Attempts

DENIAL = "websocket.http.response"  # what servers call the way to refuse a WebSocket with an answer
TOO_LARGE = f"What is sent here may be at most {LARGEST_BYTES >> 20} MiB."
_log = logging.getLogger(__name__)


class Gate:
    """ASGI application that lets through what may pass.

    Parameters
    ----------
    inner
        The application behind it.
    access
        Who has been let in.
    hosts
        Names, without port, by which this console may be called.
    attempts
        Counts tries to log in.
    """

    def __init__(
        self, inner: ASGIApp, *, access: Access, hosts: Collection[str], attempts: Attempts | None = None
    ) -> None:
        self._inner, self._access, self._hosts = inner, access, frozenset(name.lower() for name in hosts)
        self._desk, self._sockets = Desk(access, attempts=attempts), OpenSockets()

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
        found = await self._judged(scope, receive, headers)
        if not isinstance(found, Visitor):
            await _refuse(found, scope, receive, safe)
        elif scope["type"] == "websocket":
            await self._pass_socket(_marked(scope, found), receive, send, headers)
        else:
            await self._pass(_marked(scope, found), receive, with_nonce(safe, nonce), safe)

    async def _judged(self, scope: Scope, receive: Receive, headers: Mapping[str, str]) -> Visitor | Response:
        """Who may pass, or what is answered instead."""
        if is_repeated(scope) or not is_plain_path(scope["path"]):
            return refusal("This request is not in good form.", HTTPStatus.BAD_REQUEST, asked=headers)
        local = (scope.get("server") or ("",))[0]
        if not is_known(headers.get("host", ""), names=self._hosts, local=local):
            sentence = "This console is not called by that name (tsis console --allow-host adds one)."
            return refusal(sentence, HTTPStatus.MISDIRECTED_REQUEST, asked=headers)
        if not is_own_origin(scope, headers):
            return refusal("Pages of other places may not use this console.", HTTPStatus.FORBIDDEN, asked=headers)
        if announced_bytes(headers) > LARGEST_BYTES:
            return refusal(TOO_LARGE, HTTPStatus.REQUEST_ENTITY_TOO_LARGE, asked=headers)
        if scope["type"] == "http" and scope["path"] in PLACES:
            return await self._desk.answer(scope, receive, headers)
        visitor = self._access.visitor(headers)
        given, address = _key_and_rest(scope)
        opens = scope["type"] == "http" and scope["method"] == "GET"
        if opens and given and self._access.is_token(given):  # who is in already shall not keep the key on display
            others = {"set-cookie": self._access.cookie()} if visitor is None else {}
            return onward(address, asked=headers, others=others)
        if visitor is None:
            return self._refused(opens, address, headers)
        if scope["type"] == "websocket" and self._sockets.full:
            return refusal("Too many pages are open.", HTTPStatus.SERVICE_UNAVAILABLE, asked=headers)
        return visitor

    def _refused(self, opens: bool, address: str, headers: Mapping[str, str]) -> Response:
        """Say where the door is."""
        if opens and self._access.logins is not None and "text/html" in headers.get("accept", ""):
            return RedirectResponse(f"{LOGIN}?{urlencode({'then': address})}", HTTPStatus.SEE_OTHER)
        needed = {"www-authenticate": "Bearer"}
        return refusal(KEY_NEEDED, HTTPStatus.UNAUTHORIZED, asked=headers, others=needed)

    async def _pass(self, scope: Scope, receive: Receive, send: Send, plain: Send) -> None:
        body = CappedBody(receive, send)
        try:
            await self._inner(scope, body.receive, body.send)
        except Exception:
            if not body.too_large:
                _log.exception("%s %s failed", scope["method"], scope["path"])
        if not body.answered:
            large = body.too_large
            sentence, status = (TOO_LARGE, 413) if large else (FAILED, 500)
            await refusal(sentence, HTTPStatus(status), asked=headers_of(scope))(scope, receive, plain)

    async def _pass_socket(self, scope: Scope, receive: Receive, send: Send, headers: Mapping[str, str]) -> None:
        def stays() -> bool:
            return self._access.visitor(headers) is not None

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


def _marked(scope: Scope, visitor: Visitor) -> Scope:
    """The scope as those behind the gate see it."""
    state = {**scope.get("state", {}), VISITOR: visitor}
    return {**scope, "headers": without_forwarded(scope["headers"]), "state": state}


async def _refuse(answer: Response, scope: Scope, receive: Receive, send: Send) -> None:
    if scope["type"] == "http" or DENIAL in scope.get("extensions", {}):
        await answer(scope, receive, send)
    else:
        await send({"type": "websocket.close", "code": POLICY_VIOLATION})
