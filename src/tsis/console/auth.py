"""Who may use the console: key, logins, sessions, and checks of every request."""

from __future__ import annotations

import asyncio
import hashlib
import hmac
import ipaddress
import json
import logging
import math
import os
import re
import secrets
import stat
import threading
import time
import unicodedata
from contextlib import suppress
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from functools import cache
from html import escape
from http import HTTPStatus
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs, quote, urlencode

import platformdirs
from argon2 import PasswordHasher
from argon2.exceptions import InvalidHashError, VerificationError
from itsdangerous import BadData, URLSafeSerializer
from starlette.requests import ClientDisconnect, Request
from starlette.responses import HTMLResponse, PlainTextResponse, RedirectResponse

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.errors import FileInputError, InputError, UnknownNameError
from tsis.files.atomic import make_folder_durably, write_durably

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Collection, Mapping

    from starlette.requests import HTTPConnection
    from starlette.responses import Response
    from starlette.types import ASGIApp, Message, Receive, Scope, Send


FOLDER = "TSIS_CONSOLE_DIR"
OTHERS = stat.S_IRWXG | stat.S_IRWXO
LARGEST_SECRET = 2**20


def console_folder() -> Path:
    """Where this user's console keeps its secrets: ``$TSIS_CONSOLE_DIR``, or a folder among this user's data."""
    return Path(os.environ.get(FOLDER) or Path(platformdirs.user_data_dir("tsis")) / "console")


def read_private(path: Path) -> bytes | None:
    """Contents of the file; None when there is none.

    Raises `FileInputError` when it cannot be read, or others than this user could have read or written it.
    """
    try:
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0))
    except FileNotFoundError:
        return None
    except OSError as error:
        raise _unreadable(path, error) from error
    try:
        _require_private(path, os.fstat(handle))
        return os.read(handle, LARGEST_SECRET)
    except OSError as error:
        raise _unreadable(path, error) from error
    finally:
        os.close(handle)


def write_private(path: Path, content: bytes, *, replace: bool = True) -> None:
    """Write a file that this user alone may read, whole or not at all; its folder is created when missing.

    Raises `FileExistsError` when it may not replace an existing one, and `FileInputError` when it cannot be written.
    """
    try:
        make_folder_durably(path.parent, private=True)
        write_durably(path, content, replace=replace, private=True)
    except FileExistsError:
        if path.parent.is_dir():
            raise
        raise FileInputError(f"{path.parent} must be a folder; got a file (set {FOLDER} to another)") from None
    except OSError as error:
        raise FileInputError(
            f"{path} must be a place that can be written; got: {error.strerror or error} "
            f"(set {FOLDER} to another folder)"
        ) from error


def _unreadable(path: Path, error: OSError) -> FileInputError:
    return FileInputError(f"{path} must be a file that can be read; got: {error.strerror or error}")


def _require_private(path: Path, status: os.stat_result) -> None:
    if not stat.S_ISREG(status.st_mode):
        raise FileInputError(f"{path} must be a plain file; got something else")
    if os.name != "posix":  # elsewhere folders of users are closed to others, and modes say nothing
        return
    if status.st_mode & OTHERS:
        mode = stat.S_IMODE(status.st_mode)
        raise FileInputError(f"{path} must be readable by its owner alone; got mode {mode:04o} (chmod 600 {path})")
    if status.st_uid != os.geteuid():
        raise FileInputError(f"{path} must belong to user {os.geteuid()}; got user {status.st_uid}")


TOKEN_BYTES = 32
TOKEN_FILE = "token"
_TOKEN = re.compile(r"[A-Za-z0-9_-]{43}")


def saved_token(*, new: bool = False, folder: Path | None = None) -> str:
    """The token of this user's last start; a new one with ``new``, which ends every earlier session.

    Raises `FileInputError` when its file cannot be read or written, others could read it, or it contains no token.
    """
    path = (folder or console_folder()) / TOKEN_FILE
    if new:
        token = secrets.token_urlsafe(TOKEN_BYTES)
        write_private(path, token.encode())
        return token
    if read_private(path) is None:
        with suppress(FileExistsError):  # another console of this user was quicker: its key is the key
            write_private(path, secrets.token_urlsafe(TOKEN_BYTES).encode(), replace=False)
    token = (read_private(path) or b"").decode("latin-1").strip()
    if not _TOKEN.fullmatch(token):
        raise FileInputError(
            f"{path} must hold the console's key; it is damaged (tsis console --new-token makes another)"
        )
    return token


DAY_S = 86400
KEY_S = 7 * DAY_S  # of who came with the console's key
LOGIN_S = DAY_S // 2  # of who came with a name and a password: a working day
LONGEST_COOKIE = 512
ENDED = "ended.json"


@dataclass(frozen=True, slots=True, kw_only=True)
class Session:
    """Contents of a cookie."""

    identity: str  # different for each session
    name: str
    proof: str  # a mark of the login's password; name and proof are empty with the console's key
    ends_s: int  # seconds since 1970


class Sessions:
    """Makes and reads the cookies.

    A cookie contains no secret: it is signed by a key that is derived from the console's token, so that neither can be
    computed from the other, and a new token ends every session. Sessions that were ended early are saved in ``folder``,
    or in memory alone without one; ``clock`` gives seconds since 1970.
    """

    def __init__(self, token: str, *, folder: Path | None = None, clock: Callable[[], float] = time.time) -> None:
        self._signer = URLSafeSerializer(
            token,
            salt="tsis console session",
            signer_kwargs={"key_derivation": "hmac", "digest_method": hashlib.sha256},
        )
        self._file, self._clock = None if folder is None else folder / ENDED, clock
        self._ending = threading.Lock()
        self._ended = self._read()

    def cookie(self, *, name: str = "", proof: str = "") -> tuple[str, int]:
        """The value of a new session's cookie, and for how many seconds it holds."""
        lasts_s = LOGIN_S if name else KEY_S
        fields = [secrets.token_urlsafe(12), name, proof, int(self._clock()) + lasts_s]
        return str(self._signer.dumps(fields)), lasts_s

    def read(self, value: str) -> Session | None:
        """The session of a cookie; None when it is not ours, was changed, is over or was ended."""
        if not value or len(value) > LONGEST_COOKIE or not value.isascii():
            return None
        try:
            fields = self._signer.loads(value)
            if self._signer.dumps(fields) != value:  # base64 spells one signature in several ways
                return None
            identity, name, proof, ends_s = fields
            session = Session(identity=str(identity), name=str(name), proof=str(proof), ends_s=int(ends_s))
        except (BadData, ValueError, TypeError):
            return None
        return None if session.ends_s <= self._clock() or session.identity in self._ended else session

    def end(self, session: Session) -> None:
        """End a session early; it stays ended after a restart of the console.

        Sessions that another console of this user has ended meanwhile are read too. Raises `FileInputError` when the
        file cannot be written; the session is then ended until the restart.
        """
        with self._ending:
            self._ended = {**self._ended, session.identity: session.ends_s}  # before anything that can fail
            now = self._clock()
            self._ended = {one: ends_s for one, ends_s in {**self._read(), **self._ended}.items() if ends_s > now}
            if self._file is not None:
                write_private(self._file, json.dumps(self._ended).encode())

    def _read(self) -> dict[str, int]:
        content = read_private(self._file) if self._file is not None else None
        try:
            ended = json.loads(content) if content else {}
            return {str(identity): int(ends_s) for identity, ends_s in ended.items()}
        except (ValueError, TypeError, AttributeError, OverflowError, RecursionError):
            return {}  # nothing that a damaged file could tell is worth a console that does not start


LOGINS_FILE = "logins.json"
SHORTEST_PASSWORD, LONGEST_PASSWORD = 12, 1024
MOST_LOGINS = 200
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
        self._path = (folder or console_folder()) / LOGINS_FILE

    def names(self) -> tuple[str, ...]:
        """Those who have a login, in alphabetical order.

        Raises
        ------
        FileInputError
            When the file is damaged or open to others.
        """
        return tuple(sorted(_logins(self._path)))

    def created(self, name: str) -> str:
        """When this login got its password (ISO 8601, UTC)."""
        return _logins(self._path)[name].given

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
        logins = {**_logins(self._path), name: login}
        if len(logins) > MOST_LOGINS:
            raise InputError(f"logins must be at most {MOST_LOGINS}; got {len(logins)} (remove one first)")
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
        logins = _logins(self._path)
        if logins.pop(name, None) is None:
            raise UnknownNameError(
                f"name must be one of {', '.join(sorted(logins)) or 'no logins at all'}; got {name!r:.60}"
            )
        self._write(logins)

    def check(self, name: str, password: str) -> Login | None:
        """The login, when name and password are right; it takes as long for a wrong name as for a wrong password."""
        login = _logins(self._path).get(name)
        hashed = NOBODY if login is None else login.hash
        try:
            ARGON2ID.verify(hashed, _plain(password[: LONGEST_PASSWORD + 1]))
        except (VerificationError, InvalidHashError):
            return None
        return login

    def holds(self, name: str, proof: str) -> bool:
        """Whether there is still a login of that name with the password that it had; False for a damaged file."""
        try:
            login = _logins(self._path).get(name)
        except FileInputError:
            return False
        return login is not None and login.proof == proof

    def _write(self, logins: dict[str, Login]) -> None:
        content = json.dumps({"logins": [asdict(login) for login in logins.values()]}, indent=1)
        write_private(self._path, content.encode())


def _logins(path: Path) -> dict[str, Login]:
    content = read_private(path)
    if content is None:
        return {}
    try:
        logins = [_login(**item) for item in json.loads(content)["logins"]]
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
    if not SHORTEST_PASSWORD <= len(_plain(password)) <= LONGEST_PASSWORD:
        raise InputError(
            f"password must have {SHORTEST_PASSWORD} to {LONGEST_PASSWORD} characters; got {len(password)} "
            "(a few words will do)"
        )


def _plain(password: str) -> str:
    """One spelling of a password, whichever keyboard wrote it."""
    return unicodedata.normalize("NFKC", password).encode("utf-8", "replace").decode()


CLIENT = "client"


def client_name(connection: HTTPConnection) -> str:
    """Name of the login that sent this request or opened this WebSocket; empty with the console's key.

    Examples
    --------
    In a page: ``client_name(ui.context.client.request)``.
    """
    return str(connection.scope.get("state", {}).get(CLIENT, ""))


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
    headers: dict[str, str] = {}
    for raw_name, raw_value in scope["headers"]:
        name, value = raw_name.decode("latin-1").lower(), raw_value.decode("latin-1")
        between = "; " if name == "cookie" else ", "
        headers[name] = f"{headers[name]}{between}{value}" if name in headers else value
    return headers


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
    address = ipaddress.ip_address(text.partition("%")[0])
    mapped = address.ipv4_mapped if isinstance(address, ipaddress.IPv6Address) else None
    return mapped or address


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

    def client_name(self, headers: Mapping[str, str]) -> str | None:
        """Name of the login that sends these headers, empty with the console's key; None for who was not let in."""
        authorization = headers.get("authorization", "")
        if authorization.lower().startswith(BEARER):
            return "" if self.is_token(authorization[len(BEARER) :].strip()) else None
        session = self.session(headers)
        return None if session is None else session.name

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


LOGIN, LOGOUT = "/login", "/logout"
FAILED = "An unexpected error occurred. Saved data are safe; the console's log has the details."
KEY_NEEDED = "Open the address that the console showed at its start: it contains the access key."


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
    hidden = f'<input type="hidden" name="then" value="{escape(then)}">'
    button = "<button>Log in</button>"
    form = f'<form method="post" action="{LOGIN}">{alert}{hidden}{inputs}{button}</form>'
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


def logout_page(name: str) -> Response:
    """Ask whether to go."""
    who = f"Logged in as {escape(name)}." if name else "Logged in with the console's key."
    button = "<button>Log out</button>"
    form = f'<p>{who}</p><form method="post" action="{LOGOUT}">{button}</form>'
    return _page("Log out of the console", form, HTTPStatus.OK, None)


def gone_page(others: Mapping[str, str], *, logins: bool) -> Response:
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
    plain = text.isprintable() and "\\" not in text
    return text if plain and text.startswith("/") and not text.startswith("//") else "/"


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


WINDOW_S = 60.0
A_MINUTE = 5  # tries from one address
A_MINUTE_OVER_ALL = 30  # a password of twelve characters outlasts any number of them
NETWORK_OF_ONE = 64  # bits of an IPv6 address that one customer has whole


class LoginBound:
    """Bounds login attempts of a minute, by address and over all; ``clock`` gives monotonic seconds.

    Attempts are counted before the password is checked, so that concurrent ones count too.
    """

    def __init__(self, *, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._tries: list[tuple[float, str]] = []  # of the last minute, at most `A_MINUTE_OVER_ALL`

    def wait_s(self, address: str) -> float:
        """Count a try from this address; the seconds that it must wait first, 0 when it may go on.

        Examples
        --------
        >>> bound = LoginBound(clock=lambda: 0.0)
        >>> [bound.wait_s("192.0.2.7") for _ in range(7)]
        [0.0, 0.0, 0.0, 0.0, 0.0, 60.0, 60.0]
        """
        now, own = self._clock(), network(address)
        self._tries = [item for item in self._tries if now - item[0] < WINDOW_S]
        times, own_times = [when for when, _ in self._tries], [when for when, one in self._tries if one == own]
        for before, most in ((own_times, A_MINUTE), (times, A_MINUTE_OVER_ALL)):
            if len(before) >= most:
                return before[0] + WINDOW_S - now
        self._tries.append((now, own))
        return 0.0


def network(address: str) -> str:
    """What counts as one: an IPv4 address, or the network of an IPv6 address."""
    try:
        number = _address(address)
    except ValueError:
        return address
    if isinstance(number, ipaddress.IPv4Address):
        return str(number)
    return str(ipaddress.ip_network((number, NETWORK_OF_ONE), strict=False))


class AuthRoutes:
    """Logs users in and out; ``tries`` bounds the attempts."""

    def __init__(self, access: Access, *, tries: LoginBound | None = None) -> None:
        self._access, self._tries = access, tries or LoginBound()
        self._hashing = asyncio.Semaphore(AT_ONCE)

    async def respond(self, scope: Scope, receive: Receive, headers: Mapping[str, str]) -> Response:
        """The response at `LOGIN` and `LOGOUT`."""
        method = scope["method"]
        if method not in ("GET", "HEAD", "POST"):
            message, allowed = "This address accepts GET, HEAD and POST only.", {"allow": "GET, HEAD, POST"}
            return refusal(message, HTTPStatus.METHOD_NOT_ALLOWED, requested=headers, others=allowed)
        if scope["path"] == LOGOUT:
            return await self._logout(headers, leaves=method == "POST")
        logins = self._access.logins
        if logins is None:
            return refusal(KEY_NEEDED, HTTPStatus.UNAUTHORIZED, requested=headers)
        if method != "POST":
            query = parse_qs(scope.get("query_string", b"").decode("latin-1"))
            return login_page(then=local_address(query.get("then", ["/"])[0]))
        return await self._login(Request(scope, receive), headers, logins)

    async def _login(self, request: Request, headers: Mapping[str, str], logins: Logins) -> Response:
        form = await _form(request)
        if form is None:
            message = "The name and password were too long or took too long to arrive."
            return refusal(message, HTTPStatus.BAD_REQUEST, requested=headers)
        name, then = form.get("name", ""), local_address(form.get("then", "/"))
        address = "" if request.client is None else request.client.host
        wait_s = self._tries.wait_s(address)
        if wait_s:
            seconds = math.ceil(wait_s)
            return login_page(
                then=then,
                wrong=f"Too many attempts: try again in {seconds} s.",
                status=HTTPStatus.TOO_MANY_REQUESTS,
                others={"retry-after": str(seconds)},
            )
        try:
            async with self._hashing:
                login = await asyncio.to_thread(logins.check, name, form.get("password", ""))
        except FileInputError as error:
            _log.error("nobody can log in: %s", error)
            message = "Login is impossible: the file of logins cannot be read."
            return refusal(message, HTTPStatus.SERVICE_UNAVAILABLE, requested=headers)
        if login is None:
            _log.warning("a login from %s failed", address)
            return login_page(then=then, wrong=WRONG, status=HTTPStatus.UNAUTHORIZED)
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
        others = {"set-cookie": self._access.no_cookie()}
        return gone_page(others, logins=self._access.logins is not None)


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
            kept = [(name, value) for name, value in message.get("headers", []) if name.lower() not in added]
            names = {name.lower() for name, _ in kept}
            if b"cache-control" not in names:
                kept.append((b"cache-control", b"no-cache" if b"etag" in names else b"no-store"))
            message["headers"] = [*kept, *added.items()]
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


class AuthMiddleware:
    """ASGI application that passes authenticated requests to ``inner``.

    ``hosts`` are the names, without port, by which this console may be called; ``tries`` bounds the attempts to log in.
    """

    def __init__(
        self, inner: ASGIApp, *, access: Access, hosts: Collection[str], tries: LoginBound | None = None
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
        client = await self._identify(scope, receive, headers)
        if not isinstance(client, str):
            await _refuse(client, scope, receive, safe)
        elif scope["type"] == "websocket":
            await self._pass_socket(_marked(scope, client), receive, send, headers)
        else:
            await self._pass(_marked(scope, client), receive, with_nonce(safe, nonce), safe)

    async def _identify(self, scope: Scope, receive: Receive, headers: Mapping[str, str]) -> str | Response:
        """Who may pass, or what is answered instead."""
        if is_repeated(scope) or not is_plain_path(scope["path"]):
            return refusal("The request is malformed.", HTTPStatus.BAD_REQUEST, requested=headers)
        local = (scope.get("server") or ("",))[0]
        if not is_known(headers.get("host", ""), names=self._hosts, local=local):
            message = "The console does not accept this host name; whoever starts it can allow the name."
            return refusal(message, HTTPStatus.MISDIRECTED_REQUEST, requested=headers)
        if not is_own_origin(scope, headers):
            return refusal("Requests from other sites are refused.", HTTPStatus.FORBIDDEN, requested=headers)
        if announced_bytes(headers) > LARGEST_BYTES:
            return refusal(TOO_LARGE, HTTPStatus.REQUEST_ENTITY_TOO_LARGE, requested=headers)
        if scope["type"] == "http" and scope["path"] in LOGIN_PATHS:
            return await self._auth_routes.respond(scope, receive, headers)
        client = self._access.client_name(headers)
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

    async def _pass(self, scope: Scope, receive: Receive, send: Send, plain_send: Send) -> None:
        body = CappedBody(receive, send)
        try:
            await self._inner(scope, body.receive, body.send)
        except Exception:
            if not body.too_large:
                _log.exception("%s %s failed", scope["method"], scope["path"])
        if not body.response_started:
            large = body.too_large
            message, status = (TOO_LARGE, 413) if large else (FAILED, 500)
            await refusal(message, HTTPStatus(status), requested=headers_of(scope))(scope, receive, plain_send)

    async def _pass_socket(self, scope: Scope, receive: Receive, send: Send, headers: Mapping[str, str]) -> None:
        def stays() -> bool:
            return self._access.client_name(headers) is not None

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


def _marked(scope: Scope, client: str) -> Scope:
    """The scope of the application behind the authentication."""
    state = {**scope.get("state", {}), CLIENT: client}
    return {**scope, "headers": without_forwarded(scope["headers"]), "state": state}


async def _refuse(response: Response, scope: Scope, receive: Receive, send: Send) -> None:
    if scope["type"] == "http" or DENIAL in scope.get("extensions", {}):
        await response(scope, receive, send)
    else:
        await send({"type": "websocket.close", "code": POLICY_VIOLATION})


MOST_SOCKETS = 64  # eight open pages of four tablets
CHECK_EVERY_S = 2.0
POLICY_VIOLATION = 1008  # code by which a WebSocket is closed


class OpenSockets:
    """Counts WebSockets, at most ``most`` at once, and cancels those of sessions that are over."""

    def __init__(self, *, most: int = MOST_SOCKETS) -> None:
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
            while task.cancelling():
                task.uncancel()
            return True
        else:
            return task in self._cut
        finally:
            self._open.pop(task, None)
            self._cut.discard(task)

    def check(self) -> None:
        """Cancel those whose client is not authenticated any more, or cannot be checked.

        What is open still at the next check is cancelled again: handlers of events swallow a cancellation.
        """
        for task, stays in list(self._open.items()):
            if task in self._cut:
                task.cancel()
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
