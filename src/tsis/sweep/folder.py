"""The folder of a data set: new, or one that the same plan began; one sweep at a time."""

from __future__ import annotations

import os
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tsis.instrument import printable_path
from tsis.model.durable import UNFINISHED
from tsis.model.errors import FileInputError
from tsis.sweep.manifest import LIBRARIES, MANIFEST_FILE, data_set_key, read_manifest, write_manifest
from tsis.sweep.shards import NAME, data_set_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping


def as_folder(folder: str | os.PathLike[str]) -> Path:
    """The absolute path of a folder that need not exist.

    Raises
    ------
    FileInputError
        When no folder can have this name.
    """
    try:
        return Path(folder).resolve()
    except (OSError, ValueError, TypeError) as error:
        raise FileInputError(f"folder must be the name of a folder; got {folder!r:.80}") from error


@contextmanager
def begun(folder: Path, start: Mapping[str, Any]) -> Iterator[None]:
    """Make or resume the data set that ``start`` describes, and keep other sweeps out of it meanwhile.

    Raises
    ------
    FileInputError
        When the folder cannot be made, belongs to another plan or to something else, or a sweep is running in it.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with _alone(folder):
            if (folder / MANIFEST_FILE).exists():
                _refuse_other(folder, start)
            else:
                _refuse_content(folder, start)
                write_manifest(folder, start, None)
            yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise FileInputError(f"{printable_path(folder)} must be a folder that can be written; got: {reason}") from error


def _refuse_other(folder: Path, start: Mapping[str, Any]) -> None:
    found = read_manifest(folder)
    if found["plan_sha256"] != start["plan_sha256"]:
        raise FileInputError(
            f"{printable_path(folder)} must hold no other data set; got one of another plan, which differs in "
            f"{', '.join(_differences(found['plan'], start['plan']))} (choose another folder)"
        )
    versions = {"tsis": found["tsis"], **found["libraries"]}
    here = {"tsis": start["tsis"], **start["libraries"]}
    other = [
        f"{name} {versions.get(name)} and not {here[name]}"
        for name in ("tsis", *LIBRARIES)
        if versions.get(name) != here[name]
    ]
    if other:
        raise FileInputError(
            f"{printable_path(folder)} was begun with {', '.join(other)}; install those versions or choose another folder, "
            "so that all of its files are computed alike"
        )
    if found["data_set"] != data_set_key(start):
        raise FileInputError(f"{printable_path(folder)} must hold no other data set; got one of another kind")


def _differences(found: Mapping[str, Any], wanted: Mapping[str, Any]) -> list[str]:
    keys = dict.fromkeys((*wanted, *found))
    return [key for key in keys if found.get(key) != wanted.get(key)]


def _refuse_content(folder: Path, start: Mapping[str, Any]) -> None:
    """Without a manifest a folder may hold files of this data set alone, as after somebody removed a damaged one."""
    for path in sorted(folder.iterdir()):
        if path.name.endswith(UNFINISHED):
            continue
        if not NAME.fullmatch(path.name) or data_set_of(path) != data_set_key(start):
            raise FileInputError(
                f"{printable_path(folder)} must be new, empty, or a folder that this plan began; got {path.name!r:.80} in it"
            )


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    if sys.platform == "win32":
        yield
        return
    import fcntl

    # The system drops this lock with the process, however that ends; a file of our own would outlive a kill.
    handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise FileInputError(
                f"{printable_path(folder)} must not be in use; another sweep is writing into it"
            ) from error
        except OSError:
            pass  # some network file systems have no such locks; two sweeps there only do the work twice
        yield
    finally:
        os.close(handle)
