"""What stands before the console: small pages without scripts for who is not in yet, and for who goes."""

from __future__ import annotations

from functools import cache
from html import escape
from http import HTTPStatus
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING

from starlette.responses import HTMLResponse, PlainTextResponse, RedirectResponse

from tsis.__about__ import RESEARCH_USE_ONLY

if TYPE_CHECKING:
    from collections.abc import Mapping

    from starlette.requests import Request
    from starlette.responses import Response

LOGIN, LOGOUT = "/login", "/logout"
FAILED = "This failed for a reason that nobody foresaw; what was kept stays, and the console's log says more."
KEY_NEEDED = "Open the address that tsis console printed when it was started: it holds the key to this page."


def refusal(
    sentence: str, status: HTTPStatus, *, asked: Mapping[str, str], others: Mapping[str, str] | None = None
) -> Response:
    """One sentence: a page for browsers, text for the rest."""
    if "text/html" in asked.get("accept", ""):
        again = '<p><a href="">Try again</a></p>' if status == HTTPStatus.UNAUTHORIZED else ""
        return _page("tsis console", f"<p>{escape(sentence)}</p>{again}", status, others)
    return PlainTextResponse(sentence, status, headers=dict(others or {}))


async def failed(request: Request, _: Exception) -> Response:
    """Answer a request that failed; the error itself goes into the log."""
    return refusal(FAILED, HTTPStatus.INTERNAL_SERVER_ERROR, asked=request.headers)


def login_page(
    *, then: str, wrong: str = "", status: HTTPStatus = HTTPStatus.OK, others: Mapping[str, str] | None = None
) -> Response:
    """Ask for name and password; afterwards the page ``then`` is opened."""
    alert = f'<p role="alert">{escape(wrong)}</p>' if wrong else ""
    fields = {
        "Name": 'name="name" autocomplete="username" autocapitalize="none" spellcheck="false" maxlength="40" autofocus',
        "Password": 'name="password" type="password" autocomplete="current-password" maxlength="1024"',
    }
    asked = "".join(f"<label>{label}<input {field} required></label>" for label, field in fields.items())
    kept = f'<input type="hidden" name="then" value="{escape(then)}">'
    form = f'<form method="post" action="{LOGIN}">{alert}{kept}{asked}<button>Log in</button></form>'
    return _page("Log in to the console", form, status, others)


def onward(address: str, *, asked: Mapping[str, str], others: Mapping[str, str]) -> Response:
    """Send somebody on to a path of this console.

    Who was led here by a page of another place would be sent on without the cookie, for browsers keep a strict one
    from all that another place has begun. So a page of the console itself sends him on.
    """
    if asked.get("sec-fetch-site", "none") in ("none", "same-origin"):
        return RedirectResponse(address, HTTPStatus.SEE_OTHER, headers=dict(others))
    link = f'<p><a href="{escape(address)}">Go on to the console</a></p>'
    return _page("tsis console", link, HTTPStatus.OK, {**others, "refresh": f"0; url={address}"})


def logout_page(name: str) -> Response:
    """Ask whether to go."""
    who = f"You are in as {escape(name)}." if name else "You are in with the console's key."
    form = f'<p>{who}</p><form method="post" action="{LOGOUT}"><button>Log out</button></form>'
    return _page("Log out of the console", form, HTTPStatus.OK, None)


def gone_page(others: Mapping[str, str], *, logins: bool) -> Response:
    """Say that the session is over, and have the browser forget the pictures that it has kept."""
    back = f'<p><a href="{LOGIN}">Log in</a></p>' if logins else f"<p>{KEY_NEEDED}</p>"
    return _page("You are logged out", back, HTTPStatus.OK, {**others, "clear-site-data": '"cache"'})


def local_address(text: str) -> str:
    """A path of this console, whatever was asked for: nobody is sent elsewhere.

    Examples
    --------
    >>> local_address("/records/3?sort=name"), local_address("//evil.example/"), local_address("https://evil.example")
    ('/records/3?sort=name', '/', '/')
    """
    plain = text.isprintable() and "\\" not in text
    return text if plain and text.startswith("/") and not text.startswith("//") else "/"


def _page(title: str, content: str, status: HTTPStatus, others: Mapping[str, str] | None) -> Response:
    html = _template().substitute(title=title, content=content, notice=RESEARCH_USE_ONLY)
    return HTMLResponse(html, status, headers=dict(others or {}))


@cache
def _template() -> Template:
    return Template(Path(__file__).with_name("door.html").read_text(encoding="utf-8"))
