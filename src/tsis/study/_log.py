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
    """Read the log of a study, damaged or not.

    Raises
    ------
    FileInputError
        When it is missing or unreadable.
    """
    with log_lock(folder):  # never reads half of an entry
        return read_chain_file(folder / LOG_FILE, disk=disk)


def append_log(
    folder: Path,
    drafts_after: Callable[[LogChain], Sequence[LogDraft]],
    *,
    log_chain: LogChain = EMPTY_CHAIN,
    damaged: bool = False,
    disk: Disk = DISK,
) -> LogChain:
    """Append entries to the log, durably and exclusively, and return it.

    Parameters
    ----------
    folder
        Of the study.
    drafts_after
        Returns the entries to append to the present log; it may refuse by raising.
    log_chain
        The log from an earlier reading, so that only its continuation is read.
    damaged
        Whether entries may follow a damaged log.
    disk
        Writes to the disk.

    Raises
    ------
    RecordsError
        When the log is damaged, or cannot be written.
    """
    path = folder / LOG_FILE
    with log_lock(folder):
        try:
            return append_entries(
                path, drafts_after, datetime.now(UTC), log_chain=log_chain, damaged=damaged, cure=CURE, disk=disk
            )
        except OSError as error:
            raise RecordsError(
                f"{printable_path(path)} could not be written: {error.strerror or error}; earlier entries are unchanged"
            ) from error


@contextmanager
def log_lock(folder: Path) -> Iterator[None]:
    """Wait for exclusive access to the log in ``folder``."""
    with _opened(folder) as handle:
        if sys.platform != "win32":
            import fcntl

            with suppress(OSError):  # some network file systems have no such locks
                fcntl.flock(handle, fcntl.LOCK_EX)
        yield


@contextmanager
def run_lock(plan: Path) -> Iterator[None]:
    """Refuse while another run reads the targets of this ``plan``, a file that is never replaced."""
    with _opened(plan) as handle:
        if sys.platform != "win32":
            import fcntl

            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise RecordsError(
                    f"{printable_path(plan.parent)} must be read by one run at a time; another one is under way (wait "
                    "for it, or end it)"
                ) from error
            except OSError:  # as above
                pass
        yield


@contextmanager
def _opened(path: Path) -> Iterator[int]:
    if sys.platform == "win32":  # folders cannot be opened there, and nothing is locked
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
