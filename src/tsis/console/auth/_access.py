"""Checks of a request: host, origin, headers, and whose key, login or session it carries."""

from __future__ import annotations

import hmac
import ipaddress
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from tsis.console.auth._sessions import Sessions

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from starlette.requests import HTTPConnection
    from starlette.types import Scope

    from tsis.console.auth._logins import Login, Logins
    from tsis.console.auth._sessions import Session


CLIENT = "client"


@dataclass(frozen=True, slots=True, kw_only=True)
class ClientIdentity:
    """An authenticated client; the name is that of the login, and empty with the console's key."""

    name: str = ""


def client_identity(connection: HTTPConnection) -> ClientIdentity:
    """Who sent this request or opened this WebSocket.

    Examples
    --------
    In a page: ``client_identity(ui.context.client.request).name``.
    """
    result = connection.scope.get("state", {}).get(CLIENT)
    return result if isinstance(result, ClientIdentity) else ClientIdentity()


Headers = list[tuple[bytes, bytes]]

SAFE_METHODS = ("GET", "HEAD", "OPTIONS")
ONCE = (b"host", b"origin", b"authorization")  # more than one of these is somebody's trick
_HOST = re.compile(r"(\[[0-9A-Fa-f:.]{2,45}\]|[A-Za-z0-9](?:[A-Za-z0-9._-]{0,252}))(?::([0-9]{1,5}))?")
_CONTROL = re.compile(r"[\x00-\x1f\x7f]")
_SCHEMES = {"ws": "http", "wss": "https"}
# Headers of reverse proxies. There is none here, so that these are forged.
_FORWARDED = (b"forwarded", b"x-forwarded-", b"x-real-ip", b"x-original-", b"x-rewrite-", b"x-script-name")


def headers_of(scope: Scope) -> dict[str, str]:
    """The headers by their names in lower case."""
    document: dict[str, str] = {}
    for raw_name, raw_value in scope["headers"]:
        name, value = raw_name.decode("latin-1").lower(), raw_value.decode("latin-1")
        between = "; " if name == "cookie" else ", "
        document[name] = f"{document[name]}{between}{value}" if name in document else value
    return document


def is_repeated(scope: Scope) -> bool:
    """Whether a header that counts here is there more than once."""
    names = [name.lower() for name, _ in scope["headers"]]
    return any(names.count(item) > 1 for item in ONCE)


def is_plain_path(path: str) -> bool:
    """Whether a path begins at the root and holds no control character: routes end in wrong places at line ends."""
    return path.startswith("/") and _CONTROL.search(path) is None


def without_forwarded(headers: Headers) -> Headers:
    """The headers without those that only a server in between could rightly write."""
    return [(name, value) for name, value in headers if not name.lower().startswith(_FORWARDED)]


def name_of(host: str) -> str:
    """The name in a ``Host``, in lower case and without its port; empty when it is none.

    Examples
    --------
    >>> name_of("LocalHost:8642"), name_of("[::1]:8642"), name_of("localhost:8642@evil.example")
    ('localhost', '[::1]', '')
    """
    match = _HOST.fullmatch(host)
    return match[1].lower() if match else ""


def is_known(host: str, *, names: Collection[str], local: str) -> bool:
    """Whether the console is called by that ``Host``: by one of its names, or by the address that was reached.

    An unknown name is another site that resolves its own name to this address; an address cannot be redirected so.
    """
    name = name_of(host)
    if not name:
        return False
    return name in names or _same_address(name, local)


def is_own_origin(scope: Mapping[str, Any], headers: Mapping[str, str]) -> bool:
    """Whether what may change something, or opens a WebSocket, comes from a page of this console or from no page."""
    origin = headers.get("origin")
    if origin is None or (scope["type"] == "http" and scope["method"] in SAFE_METHODS):
        return True
    scheme = _SCHEMES.get(scope["scheme"], scope["scheme"])
    return origin.lower() == f"{scheme}://{headers.get('host', '')}".lower()


def _same_address(name: str, local: str) -> bool:
    try:
        return _address(name.strip("[]")) == _address(local)
    except ValueError:
        return False


def _address(text: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address:
    result = ipaddress.ip_address(text.partition("%")[0])
    mapped = result.ipv4_mapped if isinstance(result, ipaddress.IPv6Address) else None
    return mapped or result


BEARER = "bearer "


class Access:
    """The key of a running console, the sessions of browsers, and the logins.

    The token is part of the printed address, and scripts send it as ``Authorization: Bearer``. Sessions are in memory
    alone by default; without ``logins`` nobody may log in. The port is part of the cookie's name: browsers send cookies
    to every port of a machine, and two consoles must not overwrite each other's. With ``secure`` the console is served
    over TLS, and cookies go over nothing else.
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

    def client_identity(self, headers: Mapping[str, str]) -> ClientIdentity | None:
        """Who sends these headers, by their names in lower case; None for who was not let in."""
        authorization = headers.get("authorization", "")
        if authorization.lower().startswith(BEARER):
            return ClientIdentity() if self.is_token(authorization[len(BEARER) :].strip()) else None
        session = self.session(headers)
        return None if session is None else ClientIdentity(name=session.name)

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
    pairs = (part.strip().partition("=") for part in header.split(";"))
    values = [value for item, _, value in pairs if item == name]
    return values[0] if len(values) == 1 else ""  # two: somebody planted another one
