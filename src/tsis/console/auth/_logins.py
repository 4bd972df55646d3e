"""Names and passwords of those who may come in over the network."""

from __future__ import annotations

import hashlib
import json
import re
import threading
import unicodedata
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from argon2 import PasswordHasher
from argon2.exceptions import InvalidHashError, VerificationError

from tsis.console.auth._key import console_folder, read_private, write_private
from tsis.errors import FileInputError, InputError, UnknownNameError

if TYPE_CHECKING:
    from pathlib import Path


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
