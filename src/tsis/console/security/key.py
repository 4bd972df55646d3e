"""The key of this user's console: it stays the same from one start to the next, so that open pages stay open."""

from __future__ import annotations

import re
import secrets
from contextlib import suppress
from typing import TYPE_CHECKING

from tsis.console.security.private_files import console_folder, read_private, write_private
from tsis.model.errors import FileInputError

if TYPE_CHECKING:
    from pathlib import Path

BYTES = 32
FILE = "token"
_TOKEN = re.compile(r"[A-Za-z0-9_-]{43}")


def kept_token(*, new: bool = False, folder: Path | None = None) -> str:
    """Give this user's token: the one of the last start, or another.

    Parameters
    ----------
    new
        Make another one; every page and script that was let in before is then shut out.
    folder
        Where it lies; by default `console_folder`.

    Raises
    ------
    FileInputError
        When its file cannot be read or written, others could read it, or it holds no token.
    """
    path = (folder or console_folder()) / FILE
    if new:
        token = secrets.token_urlsafe(BYTES)
        write_private(path, token.encode())
        return token
    if read_private(path) is None:
        with suppress(FileExistsError):  # another console of this user was quicker: its key is the key
            write_private(path, secrets.token_urlsafe(BYTES).encode(), replace=False)
    token = (read_private(path) or b"").decode("latin-1").strip()
    if not _TOKEN.fullmatch(token):
        raise FileInputError(
            f"{path} must hold the console's key; it is damaged (tsis console --new-token makes another)"
        )
    return token
