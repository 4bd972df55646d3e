"""Checks of a request: host, origin, headers, and whose key, login or session it carries; names and passwords.

Names and passwords are those of users who may come in over the network.
"""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
import json
import re
import threading
import unicodedata
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from argon2 import PasswordHasher
from argon2.exceptions import InvalidHashError, VerificationError

from tsis.console.auth._key import console_folder, read_private, write_private
from tsis.console.auth._sessions import Sessions
from tsis.errors import FileInputError, InputError, UnknownNameError

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping
    from pathlib import Path

    from starlette.requests import HTTPConnection
    from starlette.types import Scope

    from tsis.console.auth._sessions import Session


FILE = "logins.json"
SHORTEST, LONGEST = 12, 1024
MOST = 200
NAME = re.compile(r"[A-Za-z0-9](?:[A-Za-z0-9._-]{0,38}[A-Za-z0-9])?")
ARGON2ID = PasswordHasher(time_cost=3, memory_cost=65536, parallelism=4)  # RFC 9106, for where memory is dear: 64 MiB
# Of an unknown password with the same parameters, so that unknown names take as long as known ones.
NOBODY = "$argon2id$v=19$m=65536,t=3,p=4$TylLJWqDiU/u2kZa2K8P/Q$Qjay62Sd4mM9uwf9VH7d6ptFoYFFwb34+2vGGAbxlCE"


@dataclass(frozen=True, slots=True, kw_only=True)
class Login:
    """A name, the hash of its password (argon2id), and when it was given."""

    name: str
    hash: str
    given: str

    @property
    def proof(self) -> str:
        """A mark of the password: sessions that bear another one are over."""
        return hashlib.sha256(self.hash.encode()).hexdigest()[:16]


class Logins:
    """The logins of this user's console; a change by another program counts at once.

    Parameters
    ----------
    folder
        Where their file lies; by default `console_folder`.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self._path = (folder or console_folder()) / FILE
        self._lock = threading.Lock()
        self._file_stamp: tuple[int, int, int] | None = None
        self._by_name: dict[str, Login] = {}

    def names(self) -> tuple[str, ...]:
        """Those who have a login, in alphabetical order.

        Raises
        ------
        FileInputError
            When the file is damaged or open to others.
        """
        return tuple(sorted(self._read()))

    def created(self, name: str) -> str:
        """When this login got its password (ISO 8601, UTC)."""
        return self._read()[name].given

    def add(self, name: str, password: str) -> None:
        """Give a login, or a known one another password, which ends its sessions.

        Raises
        ------
        InputError
            When the name or the password will not do.
        FileInputError
            As `names`, or when it cannot be written.
        """
        self.require_name(name)
        _require_password(password)
        login = Login(
            name=name, hash=ARGON2ID.hash(_plain(password)), given=datetime.now(UTC).isoformat(timespec="seconds")
        )
        logins = {**self._read(), name: login}
        if len(logins) > MOST:
            raise InputError(f"logins must be at most {MOST}; got {len(logins)} (remove one first)")
        self._write(logins)

    def require_name(self, name: str) -> None:
        """Refuse a name that will not do, with `InputError`."""
        if not NAME.fullmatch(name):
            raise InputError(
                "name must be 1 to 40 letters, digits, dots, dashes or underscores, with a letter or digit at "
                f"both ends; got {name!r:.60}"
            )

    def remove(self, name: str) -> None:
        """Take a login away, and with it its sessions.

        Raises
        ------
        UnknownNameError
            When there is none of that name.
        """
        logins = dict(self._read())
        if logins.pop(name, None) is None:
            raise UnknownNameError(
                f"name must be one of {', '.join(sorted(logins)) or 'no logins at all'}; got {name!r:.60}"
            )
        self._write(logins)

    def check(self, name: str, password: str) -> Login | None:
        """The login, when name and password are right; it takes as long for a wrong name as for a wrong password."""
        login = self._read().get(name)
        hashed = NOBODY if login is None else login.hash
        try:
            ARGON2ID.verify(hashed, _plain(password[: LONGEST + 1]))
        except (VerificationError, InvalidHashError):
            return None
        return login

    def holds(self, name: str, proof: str) -> bool:
        """Whether there is still a login of that name with the password that it had; False for a damaged file."""
        try:
            login = self._read().get(name)
        except FileInputError:
            return False
        return login is not None and login.proof == proof

    def _read(self) -> dict[str, Login]:
        with self._lock:
            try:
                result = self._path.stat()
            except OSError:
                self._file_stamp, self._by_name = None, {}
                return self._by_name
            observed = (result.st_mtime_ns, result.st_ino, result.st_mode)
            if observed != self._file_stamp:
                self._by_name = _logins(self._path)
                self._file_stamp = observed
            return self._by_name

    def _write(self, logins: dict[str, Login]) -> None:
        content = json.dumps({"logins": [asdict(login) for login in logins.values()]}, indent=1)
        write_private(self._path, content.encode())


def _logins(path: Path) -> dict[str, Login]:
    content = read_private(path)
    if content is None:
        return {}
    try:
        logins = [_login(**load) for load in json.loads(content)["logins"]]
    except (ValueError, TypeError, KeyError) as error:
        raise FileInputError(
            f"{path} must hold the console's logins; it is damaged (remove it and add them again)"
        ) from error
    return {login.name: login for login in logins}


def _login(*, name: str, hash: str, given: str) -> Login:  # noqa: A002 - as in the file
    if not isinstance(hash, str) or not isinstance(given, str) or not NAME.fullmatch(name):
        raise TypeError
    return Login(name=name, hash=hash, given=given)


def _require_password(password: str) -> None:
    if not SHORTEST <= len(_plain(password)) <= LONGEST:
        raise InputError(
            f"password must have {SHORTEST} to {LONGEST} characters; got {len(password)} (a few words will do)"
        )


def _plain(password: str) -> str:
    """One spelling of a password, whichever keyboard wrote it."""
    return unicodedata.normalize("NFKC", password).encode("utf-8", "replace").decode()


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
