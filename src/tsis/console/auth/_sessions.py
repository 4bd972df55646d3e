"""Sessions of browsers: signed cookies with an end, and those that were ended before it."""

from __future__ import annotations

import hashlib
import json
import secrets
import threading
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from itsdangerous import BadData, URLSafeSerializer

from tsis.console.auth._key import read_private, write_private

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path


DAY_S = 86400
KEY_S = 7 * DAY_S  # of who came with the console's key
LOGIN_S = DAY_S // 2  # of who came with a name and a password: a working day
LONGEST = 512
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
        if not value or len(value) > LONGEST or not value.isascii():
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
            self._ended = {name: ends for name, ends in {**self._read(), **self._ended}.items() if ends > now}
            if self._file is not None:
                write_private(self._file, json.dumps(self._ended).encode())

    def _read(self) -> dict[str, int]:
        content = read_private(self._file) if self._file is not None else None
        try:
            saved = json.loads(content) if content else {}
            return {str(name): int(ends) for name, ends in saved.items()}
        except (ValueError, TypeError, AttributeError, OverflowError, RecursionError):
            return {}  # nothing that a damaged file could tell is worth a console that does not start
