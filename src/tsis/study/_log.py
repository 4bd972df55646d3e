"""The log of a study: a hash-chained file to which one process at a time appends."""

from __future__ import annotations

import os
import sys
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from tsis.errors import RecordsError
from tsis.files import DISK, EMPTY_CHAIN, Disk, LogChain, LogDraft, append_entries, printable_path, read_chain_file

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path


LOG_FILE = "log.jsonl"
CURE = "tsis study verify tells all"


def read_log(folder: Path, *, disk: Disk = DISK) -> LogChain:
    """The log of a study as it is found.

    Raises
    ------
    FileInputError
        When there is none that can be read.
    """
    with log_lock(folder):  # an entry that is just being appended is read as a whole
        return read_chain_file(folder / LOG_FILE, disk=disk)


def append_log(
    folder: Path,
    drafts_after: Callable[[LogChain], Sequence[LogDraft]],
    *,
    log_chain: LogChain = EMPTY_CHAIN,
    damaged: bool = False,
    disk: Disk = DISK,
) -> LogChain:
    """Append entries to the log and return it; they are on the disk by then. Nobody else appends meanwhile.

    Parameters
    ----------
    folder
        Of the study.
    drafts_after
        Given the log as it is at that moment, what to append; it may refuse by raising.
    log_chain
        The log as it was read before, so that only what follows is read.
    damaged
        Whether entries may follow a log that does not fit.
    disk
        By which steps they get onto the disk.

    Raises
    ------
    RecordsError
        When the log does not fit, or cannot be written.
    """
    path = folder / LOG_FILE
    with log_lock(folder):
        try:
            return append_entries(
                path, drafts_after, datetime.now(UTC), log_chain=log_chain, damaged=damaged, cure=CURE, disk=disk
            )
        except OSError as error:
            raise RecordsError(
                f"{printable_path(path)} could not be written: {error.strerror or error}; what was entered before "
                "is as it was"
            ) from error


@contextmanager
def log_lock(folder: Path) -> Iterator[None]:
    """Wait until nobody else adds lines to the log in ``folder``: it takes others a moment."""
    with _opened(folder) as handle:
        if sys.platform != "win32":
            import fcntl

            with suppress(OSError):  # some network file systems have no such locks
                fcntl.flock(handle, fcntl.LOCK_EX)
        yield


@contextmanager
def run_lock(plan: Path) -> Iterator[None]:
    """Refuse while another run reads the targets of this ``plan``, which is written once and never replaced."""
    with _opened(plan) as handle:
        if sys.platform != "win32":
            import fcntl

            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise RecordsError(
                    f"{printable_path(plan.parent)} must be read by one run at a time; another one is under "
                    f"way (wait for it, "
                    f"or end it)"
                ) from error
            except OSError:  # as above
                pass
        yield


@contextmanager
def _opened(path: Path) -> Iterator[int]:
    if sys.platform == "win32":  # where folders cannot be opened, and nothing is locked
        yield -1
        return
    try:
        handle = os.open(path, os.O_RDONLY)
    except OSError as error:
        raise RecordsError(f"{printable_path(path)} must be part of a study; got: {error.strerror}") from error
    try:
        yield handle
    finally:
        os.close(handle)
