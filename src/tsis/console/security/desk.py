"""Where people log in and out; the one place that answers those who are not in."""

from __future__ import annotations

import asyncio
import logging
import math
from http import HTTPStatus
from typing import TYPE_CHECKING
from urllib.parse import parse_qs

from starlette.requests import ClientDisconnect, Request
from starlette.responses import RedirectResponse

from tsis.console.security.attempts import Attempts
from tsis.console.security.door import (
    KEY_NEEDED,
    LOGIN,
    LOGOUT,
    gone_page,
    local_address,
    login_page,
    logout_page,
    refusal,
)
from tsis.model.errors import FileInputError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from starlette.responses import Response
    from starlette.types import Receive, Scope

    from tsis.console.security.access import Access
    from tsis.console.security.logins import Logins

LARGEST_FORM = 8192  # bytes
FORM_S = 20.0  # in which it must have come
AT_ONCE = 2  # passwords that are hashed: each takes 64 MiB
WRONG = "This name and password do not belong together."
PLACES = (LOGIN, LOGOUT)
_log = logging.getLogger(__name__)


class Desk:
    """Logs people in and out.

    Parameters
    ----------
    access
        Keys, sessions and logins.
    attempts
        Counts tries.
    """

    def __init__(self, access: Access, *, attempts: Attempts | None = None) -> None:
        self._access, self._attempts = access, attempts or Attempts()
        self._hashing = asyncio.Semaphore(AT_ONCE)

    async def answer(self, scope: Scope, receive: Receive, headers: Mapping[str, str]) -> Response:
        """What is answered at `LOGIN` and `LOGOUT`."""
        method = scope["method"]
        if method not in ("GET", "HEAD", "POST"):
            allowed = {"allow": "GET, HEAD, POST"}
            return refusal(
                "This can be read or sent, nothing else.", HTTPStatus.METHOD_NOT_ALLOWED, asked=headers, others=allowed
            )
        if scope["path"] == LOGOUT:
            return await self._logout(headers, leaves=method == "POST")
        logins = self._access.logins
        if logins is None:
            return refusal(KEY_NEEDED, HTTPStatus.UNAUTHORIZED, asked=headers)
        if method != "POST":
            query = parse_qs(scope.get("query_string", b"").decode("latin-1"))
            return login_page(then=local_address(query.get("then", ["/"])[0]))
        return await self._login(Request(scope, receive), headers, logins)

    async def _login(self, request: Request, headers: Mapping[str, str], logins: Logins) -> Response:
        form = await _form(request)
        if form is None:
            return refusal(
                "A name and a password are neither so long nor so slow.", HTTPStatus.BAD_REQUEST, asked=headers
            )
        name, then = form.get("name", ""), local_address(form.get("then", "/"))
        address = "" if request.client is None else request.client.host
        wait_s = self._attempts.wait_s(address)
        if wait_s:
            told = f"Too many tries: the next one may be made in {_spoken(wait_s)}."
            after = {"retry-after": str(math.ceil(wait_s))}
            return login_page(then=then, wrong=told, status=HTTPStatus.TOO_MANY_REQUESTS, others=after)
        try:
            async with self._hashing:
                login = await asyncio.to_thread(logins.check, name, form.get("password", ""))
        except FileInputError as error:
            _log.error("nobody can log in: %s", error)
            return refusal(
                "Nobody can log in: the logins cannot be read.", HTTPStatus.SERVICE_UNAVAILABLE, asked=headers
            )
        if login is None:
            _log.warning("a login from %s failed", address)
            return login_page(then=then, wrong=WRONG, status=HTTPStatus.UNAUTHORIZED)
        self._attempts.succeeded(address)
        _log.info("%s logged in from %s", login.name, address)
        return RedirectResponse(then, HTTPStatus.SEE_OTHER, headers={"set-cookie": self._access.cookie(login)})

    async def _logout(self, headers: Mapping[str, str], *, leaves: bool) -> Response:
        session = self._access.session(headers)
        if session is not None and not leaves:
            return logout_page(session.name)
        if session is not None:
            try:
                await asyncio.to_thread(self._access.sessions.end, session)
            except FileInputError as error:
                _log.warning("a session that was ended comes back when the console is started anew: %s", error)
        return gone_page({"set-cookie": self._access.no_cookie()}, logins=self._access.logins is not None)


async def _form(request: Request) -> dict[str, str] | None:
    """The fields that were sent; None when they are larger than they can be, or never come."""
    content = bytearray()
    try:
        async with asyncio.timeout(FORM_S):
            async for part in request.stream():
                content += part
                if len(content) > LARGEST_FORM:
                    return None
    except (ClientDisconnect, TimeoutError):
        return None
    fields = parse_qs(content.decode("utf-8", "replace"), keep_blank_values=True)
    return {name: values[0] for name, values in fields.items()}


def _spoken(seconds: float) -> str:
    whole = math.ceil(seconds)
    return f"{whole} s" if whole < 2 * 60 else f"{math.ceil(whole / 60)} minutes"
