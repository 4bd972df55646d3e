"""Files that are whole or absent, whenever the machine or the program stops."""

from __future__ import annotations

import os
import secrets
from contextlib import suppress
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

UNFINISHED = ".unfinished"


def write_durably(path: Path, content: bytes) -> None:
    """Write ``content``; when this returns it is on the disk, and readers never see a part of it.

    Raises
    ------
    OSError
        When it cannot be written; nothing is left then.
    """
    draft = path.with_name(f".{path.name}-{secrets.token_hex(8)}{UNFINISHED}")
    try:
        with draft.open("xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        draft.replace(path)
    except BaseException:
        with suppress(OSError):
            draft.unlink()
        raise
    _sync_folder(path.parent)


def remove_unfinished(folder: Path) -> None:
    """Remove what killed writers left."""
    for draft in folder.glob(f".*{UNFINISHED}"):
        with suppress(OSError):
            draft.unlink()


def _sync_folder(folder: Path) -> None:
    # A rename lasts only when the folder itself is on the disk; other systems have no such call.
    if os.name == "posix":
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
