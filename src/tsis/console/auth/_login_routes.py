"""Login pages: small pages without scripts to log in and out."""

from __future__ import annotations

import asyncio
import logging
import math
from functools import cache
from html import escape
from http import HTTPStatus
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING
from urllib.parse import parse_qs

from starlette.requests import ClientDisconnect, Request
from starlette.responses import HTMLResponse, PlainTextResponse, RedirectResponse

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.console.auth._rate_limit import LoginRateLimiter
from tsis.errors import FileInputError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from starlette.responses import Response
    from starlette.types import Receive, Scope

    from tsis.console.auth._access import Access, Logins


LOGIN, LOGOUT = "/login", "/logout"
FAILED = "An unexpected error occurred. Saved data are safe; the console's log has the details."
KEY_NEEDED = "Open the address that tsis console printed at its start: it contains the access key."


def refusal(
    message: str, status: HTTPStatus, *, requested: Mapping[str, str], others: Mapping[str, str] | None = None
) -> Response:
    """One message: a page for browsers, text for the rest."""
    if "text/html" in requested.get("accept", ""):
        again = '<p><a href="">Try again</a></p>' if status == HTTPStatus.UNAUTHORIZED else ""
        return _page("tsis console", f"<p>{escape(message)}</p>{again}", status, others)
    return PlainTextResponse(message, status, headers=dict(others or {}))


async def failed(request: Request, _: Exception) -> Response:
    """Answer a request that failed; the error itself goes into the log."""
    return refusal(FAILED, HTTPStatus.INTERNAL_SERVER_ERROR, requested=request.headers)


def login_page(
    *,
    then: str,
    requested: Mapping[str, str],
    wrong: str = "",
    status: HTTPStatus = HTTPStatus.OK,
    others: Mapping[str, str] | None = None,
) -> Response:
    """Ask for name and password; afterwards the page ``then`` is opened."""
    alert = f'<p role="alert">{escape(wrong)}</p>' if wrong else ""
    fields = {
        "Name": 'name="name" autocomplete="username" autocapitalize="none" spellcheck="false" maxlength="40" autofocus',
        "Password": 'name="password" type="password" autocomplete="current-password" maxlength="1024"',
    }
    inputs = "".join(f"<label>{label}<input {field} required></label>" for label, field in fields.items())
    saved = f'<input type="hidden" name="then" value="{escape(then)}">'
    button = "<button>Log in</button>"
    form = f'<form method="post" action="{LOGIN}">{alert}{saved}{inputs}{button}</form>'
    return _page("Log in to the console", form, status, others)


def onward(address: str, *, requested: Mapping[str, str], others: Mapping[str, str]) -> Response:
    """Redirect a browser to a path of this console.

    After a link from another site the browser would omit the strict cookie on a redirect, so that a page of the
    console itself forwards then.
    """
    if requested.get("sec-fetch-site", "none") in ("none", "same-origin"):
        return RedirectResponse(address, HTTPStatus.SEE_OTHER, headers=dict(others))
    link = f'<p><a href="{escape(address)}">Continue to the console</a></p>'
    return _page("tsis console", link, HTTPStatus.OK, {**others, "refresh": f"0; url={address}"})


def logout_page(name: str, *, requested: Mapping[str, str]) -> Response:
    """Ask whether to go."""
    who = f"Logged in as {escape(name)}." if name else "Logged in with the console's key."
    button = "<button>Log out</button>"
    form = f'<p>{who}</p><form method="post" action="{LOGOUT}">{button}</form>'
    return _page("Log out of the console", form, HTTPStatus.OK, None)


def gone_page(others: Mapping[str, str], *, logins: bool, requested: Mapping[str, str]) -> Response:
    """Say that the session is over, and have the browser delete its cached pictures."""
    link = f'<a href="{LOGIN}">Log in</a>'
    back = f"<p>{link if logins else KEY_NEEDED}</p>"
    return _page("You are logged out", back, HTTPStatus.OK, {**others, "clear-site-data": '"cache"'})


def local_address(text: str) -> str:
    """A path of this console, whatever was requested; never another site.

    Examples
    --------
    >>> local_address("/records/3?sort=name"), local_address("//evil.example/"), local_address("https://evil.example")
    ('/records/3?sort=name', '/', '/')
    """
    reference = text.isprintable() and "\\" not in text
    return text if reference and text.startswith("/") and not text.startswith("//") else "/"


def _page(title: str, content: str, status: HTTPStatus, others: Mapping[str, str] | None) -> Response:
    html = _template().substitute(title=title, content=content, notice=RESEARCH_USE_ONLY)
    return HTMLResponse(html, status, headers=dict(others or {}))


@cache
def _template() -> Template:
    return Template(Path(__file__).with_name("login.html").read_text(encoding="utf-8"))


LARGEST_FORM = 8192  # bytes
FORM_S = 20.0  # in which it must have come
AT_ONCE = 2  # passwords that are hashed: each takes 64 MiB
WRONG = "Wrong name or password."
LOGIN_PATHS = (LOGIN, LOGOUT)
_log = logging.getLogger(__name__)


class AuthRoutes:
    """Logs users in and out; ``tries`` limits the rate of attempts."""

    def __init__(self, access: Access, *, tries: LoginRateLimiter | None = None) -> None:
        self._access, self._rate_limiter = access, tries or LoginRateLimiter()
        self._hashing = asyncio.Semaphore(AT_ONCE)

    async def respond(self, scope: Scope, receive: Receive, headers: Mapping[str, str]) -> Response:
        """The response at `LOGIN` and `LOGOUT`."""
        method = scope["method"]
        if method not in ("GET", "HEAD", "POST"):
            allowed = {"allow": "GET, HEAD, POST"}
            return refusal(
                "This address accepts GET, HEAD and POST only.",
                HTTPStatus.METHOD_NOT_ALLOWED,
                requested=headers,
                others=allowed,
            )
        if scope["path"] == LOGOUT:
            return await self._logout(headers, leaves=method == "POST")
        logins = self._access.logins
        if logins is None:
            return refusal(KEY_NEEDED, HTTPStatus.UNAUTHORIZED, requested=headers)
        if method != "POST":
            query = parse_qs(scope.get("query_string", b"").decode("latin-1"))
            return login_page(then=local_address(query.get("then", ["/"])[0]), requested=headers)
        return await self._login(Request(scope, receive), headers, logins)

    async def _login(self, request: Request, headers: Mapping[str, str], logins: Logins) -> Response:
        form = await _form(request)
        if form is None:
            return refusal(
                "The name and password were too long or took too long to arrive.",
                HTTPStatus.BAD_REQUEST,
                requested=headers,
            )
        name, then = form.get("name", ""), local_address(form.get("then", "/"))
        address = "" if request.client is None else request.client.host
        wait_s = self._rate_limiter.wait_s(address)
        if wait_s:
            reported = _wait_text(math.ceil(wait_s))
            after = {"retry-after": str(math.ceil(wait_s))}
            many = HTTPStatus.TOO_MANY_REQUESTS
            return login_page(then=then, requested=headers, wrong=reported, status=many, others=after)
        try:
            async with self._hashing:
                login = await asyncio.to_thread(logins.check, name, form.get("password", ""))
        except FileInputError as error:
            _log.error("nobody can log in: %s", error)
            return refusal(
                "Login is impossible: the file of logins cannot be read.",
                HTTPStatus.SERVICE_UNAVAILABLE,
                requested=headers,
            )
        if login is None:
            _log.warning("a login from %s failed", address)
            return login_page(then=then, requested=headers, wrong=WRONG, status=HTTPStatus.UNAUTHORIZED)
        self._rate_limiter.succeeded(address)
        _log.info("%s logged in from %s", login.name, address)
        return RedirectResponse(then, HTTPStatus.SEE_OTHER, headers={"set-cookie": self._access.cookie(login)})

    async def _logout(self, headers: Mapping[str, str], *, leaves: bool) -> Response:
        session = self._access.session(headers)
        if session is not None and not leaves:
            return logout_page(session.name, requested=headers)
        if session is not None:
            try:
                await asyncio.to_thread(self._access.sessions.end, session)
            except FileInputError as error:
                _log.warning("a session that was ended comes back when the console is started anew: %s", error)
        others = {"set-cookie": self._access.no_cookie()}
        return gone_page(others, logins=self._access.logins is not None, requested=headers)


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


def _wait_text(seconds: int) -> str:
    if seconds < 2 * 60:
        return f"Too many attempts: try again in {seconds} s."
    return f"Too many attempts: try again in {math.ceil(seconds / 60)} minutes."
