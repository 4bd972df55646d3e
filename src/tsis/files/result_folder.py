"""Atomic writes of result folders."""

from __future__ import annotations

import itertools
import os
import tempfile
from typing import TYPE_CHECKING

from tsis.errors import FileInputError
from tsis.files.atomic import atomic_folder

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path


ROOM = 2**22  # bytes, more than a report needs


def free_folder(requested: Path) -> Path:
    """``requested``, or the first free one of ``requested-2``, ``requested-3``, ...; may raise `FileInputError`."""
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
    """Write ``files`` (name -> bytes) atomically into a new ``folder`` and return its absolute path.

    Raises
    ------
    FileInputError
        When the folder exists or cannot be written.
    """
    try:
        with atomic_folder(folder) as draft:
            for name, content in files.items():
                (draft / name).write_bytes(content)
    except OSError as error:
        raise _refused(folder, error) from error
    return folder.resolve()


def require_absent(path: Path) -> None:
    """Raise `FileInputError` when a path exists, before any computation."""
    try:
        taken = path.is_symlink() or path.exists()
    except OSError as error:
        raise FileInputError(f"{str(path)!r:.120} must be a new name; got: {error.strerror or error}") from error
    if taken or path.name in ("", ".."):
        raise FileInputError(f"{str(path)!r:.120} must be a new name; there is such a file or folder (choose another)")


def require_room(folder: Path, *, room: int = ROOM) -> None:
    """Raise `FileInputError` unless ``room`` bytes fit beside ``folder``; for use before irreversible steps."""
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
