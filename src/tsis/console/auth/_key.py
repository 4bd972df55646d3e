"""Files of the console that only this user may read: key, logins and ended sessions."""

from __future__ import annotations

import os
import re
import secrets
import stat
from contextlib import suppress
from pathlib import Path

import platformdirs

from tsis.errors import FileInputError
from tsis.files.atomic import make_folder_durably, write_durably

FOLDER = "TSIS_CONSOLE_DIR"
OTHERS = stat.S_IRWXG | stat.S_IRWXO
LARGEST_BYTES = 2**20


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
        return os.read(handle, LARGEST_BYTES)
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


def _require_private(path: Path, result: os.stat_result) -> None:
    if not stat.S_ISREG(result.st_mode):
        raise FileInputError(f"{path} must be a plain file; got something else")
    if os.name != "posix":  # elsewhere folders of users are closed to others, and modes say nothing
        return
    if result.st_mode & OTHERS:
        mode = stat.S_IMODE(result.st_mode)
        raise FileInputError(f"{path} must be readable by its owner alone; got mode {mode:04o} (chmod 600 {path})")
    if result.st_uid != os.geteuid():
        raise FileInputError(f"{path} must belong to user {os.geteuid()}; got user {result.st_uid}")


BYTES = 32
FILE = "token"
_TOKEN = re.compile(r"[A-Za-z0-9_-]{43}")


def saved_token(*, new: bool = False, folder: Path | None = None) -> str:
    """The token of this user's last start; a new one with ``new``, which ends every earlier session.

    Raises `FileInputError` when its file cannot be read or written, others could read it, or it contains no token.
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
