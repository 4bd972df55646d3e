"""Files and folders that appear whole or not at all, and never in the place of others."""

from __future__ import annotations

import os
import secrets
import shutil
import tempfile
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from tsis.instrument.file_bytes import as_path, shown
from tsis.model.durable import DISK, UNFINISHED
from tsis.model.errors import FileInputError

if TYPE_CHECKING:
    from collections.abc import Iterator


@contextmanager
def new_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A draft to write beside ``path``; it gets that name when the block ends well, else nothing is left.

    Raises
    ------
    FileInputError
        When there is something of that name, or it cannot be written.
    """
    wanted = as_path(path)
    with _refusing(wanted):
        _require_new(wanted)
        wanted.parent.mkdir(parents=True, exist_ok=True)
        draft = wanted.with_name(f".{wanted.name}-{secrets.token_hex(8)}{UNFINISHED}")
        try:
            yield draft
            _sync(draft)
            _give_name(draft, wanted)
        except BaseException:
            with suppress(OSError):
                draft.unlink()
            raise
        DISK.sync_folder(wanted.parent)


@contextmanager
def new_folder(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A folder to fill beside ``path``; it gets that name when the block ends well, else nothing is left.

    Raises
    ------
    FileInputError
        When there is something of that name, or it cannot be written.
    """
    wanted = as_path(path)
    with _refusing(wanted):
        _require_new(wanted)
        wanted.parent.mkdir(parents=True, exist_ok=True)
        draft = Path(tempfile.mkdtemp(dir=wanted.parent, prefix=f".{wanted.name}-", suffix=UNFINISHED))
        try:
            yield draft
            for each in sorted(draft.rglob("*")):
                _sync(each)
            _sync(draft)
            draft.chmod(0o755)
            _require_new(wanted)  # a rename would take the place of an empty folder
            draft.rename(wanted)
        except BaseException:
            shutil.rmtree(draft, ignore_errors=True)
            raise
        DISK.sync_folder(wanted.parent)


def _give_name(draft: Path, wanted: Path) -> None:
    """A link refuses to take another's place, which a rename does not; some file systems have no links."""
    try:
        wanted.hardlink_to(draft)
    except FileExistsError:
        raise
    except OSError:
        _require_new(wanted)
        draft.rename(wanted)
    else:
        draft.unlink()


def _sync(path: Path) -> None:
    if path.is_dir():
        DISK.sync_folder(path)
        return
    with path.open("rb") as file:
        os.fsync(file.fileno())


def _require_new(wanted: Path) -> None:
    if wanted.name in ("", "..") or os.path.lexists(wanted):
        raise FileInputError(f"{shown(wanted)} must be a new name; there is such a file or folder (choose another)")


@contextmanager
def _refusing(wanted: Path) -> Iterator[None]:
    try:
        yield
    except FileExistsError as error:
        raise FileInputError(f"{shown(wanted)} must be a new name; it exists already (choose another)") from error
    except OSError as error:
        reason = error.strerror or str(error)
        raise FileInputError(f"{shown(wanted)} must be a place that can be written; got: {reason}") from error
