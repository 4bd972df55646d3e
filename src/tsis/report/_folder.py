"""A folder of results that appears whole or not at all."""

from __future__ import annotations

import itertools
import os
import tempfile
from typing import TYPE_CHECKING

from tsis.errors import FileInputError
from tsis.files import atomic_folder

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path


ROOM = 2**22  # bytes: more than a report takes


def free_folder(requested: Path) -> Path:
    """``requested``, or the first of ``wanted-2``, ``wanted-3``, ... that does not exist: nothing is overwritten.

    Raises
    ------
    FileInputError
        When ``requested`` does not name a new folder.
    """
    if requested.name in ("", ".."):
        raise FileInputError(f"{str(requested)!r} must name a new folder; got none to make (give it a name)")
    names = itertools.chain(
        [requested], (requested.with_name(f"{requested.name}-{number}") for number in itertools.count(2))
    )
    try:
        return next(name for name in names if not name.exists())
    except OSError as error:
        raise _refused(requested, error) from error


def write_folder(folder: Path, files: Mapping[str, bytes]) -> Path:
    """Write ``files`` (name -> bytes) into a new ``folder`` and return its absolute path.

    They appear in one step and are on the disk then, so that an interrupted run leaves no half of a result.

    Raises
    ------
    FileInputError
        When the folder cannot be written or exists already.
    """
    try:
        with atomic_folder(folder) as draft:
            for name, content in files.items():
                (draft / name).write_bytes(content)
    except OSError as error:
        raise _refused(folder, error) from error
    return folder.resolve()


def require_room(folder: Path, *, room: int = ROOM) -> None:
    """Refuse a new ``folder`` beside which ``room`` bytes cannot be written: before what cannot be taken back.

    Raises
    ------
    FileInputError
        When they cannot.
    """
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder.parent) as trial:
            trial.write(bytes(room))
            trial.flush()
            os.fsync(trial.fileno())
    except OSError as error:
        raise _refused(folder, error) from error


def _refused(folder: Path, error: OSError) -> FileInputError:
    reason = error.strerror or str(error)
    return FileInputError(f"{str(folder)!r:.120} must be a folder that can be made; got: {reason} (choose another)")
