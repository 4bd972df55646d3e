"""Who has been let in: by the key that the console printed, or by a login."""

from __future__ import annotations

import hmac
from typing import TYPE_CHECKING

from tsis.console.security.sessions import Sessions
from tsis.console.security.visitor import Visitor

if TYPE_CHECKING:
    from collections.abc import Mapping

    from tsis.console.security.logins import Login, Logins
    from tsis.console.security.sessions import Session

BEARER = "bearer "


class Access:
    """The key of a running console, the sessions of browsers, and the logins.

    Parameters
    ----------
    token
        Part of the address that the console prints; also what scripts send as ``Authorization: Bearer``.
    sessions
        Of browsers; by default sessions that are kept in memory alone.
    logins
        Who may come in by name and password; None when nobody may.
    port
        Part of the cookie's name: browsers give cookies to every port of a machine, and two consoles must not take
        each other's away.
    secure
        Whether the console is served over TLS, and cookies go over nothing else.
    """

    def __init__(
        self,
        token: str,
        *,
        sessions: Sessions | None = None,
        logins: Logins | None = None,
        port: int = 0,
        secure: bool = False,
    ) -> None:
        self._token, self.sessions, self.logins, self.secure = token, sessions or Sessions(token), logins, secure
        self.cookie_name = f"__Host-tsis-console-{port}" if secure else f"tsis-console-{port}"

    def is_token(self, given: str) -> bool:
        """Whether this is the key; it takes the same time whatever is wrong with it."""
        return hmac.compare_digest(given.encode("utf-8", "replace"), self._token.encode())

    def visitor(self, headers: Mapping[str, str]) -> Visitor | None:
        """Who sends these headers, by their names in lower case; None for who was not let in."""
        authorization = headers.get("authorization", "")
        if authorization.lower().startswith(BEARER):
            return Visitor() if self.is_token(authorization[len(BEARER) :].strip()) else None
        session = self.session(headers)
        return None if session is None else Visitor(name=session.name)

    def session(self, headers: Mapping[str, str]) -> Session | None:
        """The session of a browser; None when it has none, or its login was taken away or got another password."""
        session = self.sessions.read(cookie_of(headers.get("cookie", ""), self.cookie_name))
        if session is None or not session.name:
            return session
        holds = self.logins is not None and self.logins.holds(session.name, session.proof)
        return session if holds else None

    def cookie(self, login: Login | None = None) -> str:
        """The header that lets a browser in from now on."""
        name, proof = ("", "") if login is None else (login.name, login.proof)
        value, lasts_s = self.sessions.cookie(name=name, proof=proof)
        return self._header(value, lasts_s)

    def no_cookie(self) -> str:
        """The header that takes the cookie away."""
        return self._header("", 0)

    def _header(self, value: str, lasts_s: int) -> str:
        secure = "; Secure" if self.secure else ""
        return f"{self.cookie_name}={value}; HttpOnly; SameSite=Strict; Path=/; Max-Age={lasts_s}{secure}"


def cookie_of(header: str, name: str) -> str:
    """The cookie of that name in a header of cookies; empty when there is none, or more than one.

    Examples
    --------
    >>> cookie_of("theme=dark; tsis-console-8642=abc; broken", "tsis-console-8642")
    'abc'
    """
    pairs = (each.strip().partition("=") for each in header.split(";"))
    values = [value for each, _, value in pairs if each == name]
    return values[0] if len(values) == 1 else ""  # two: somebody planted another one
