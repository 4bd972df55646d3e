"""The log of a study: a hash-chained file to which one process at a time appends."""

from __future__ import annotations

from contextlib import AbstractContextManager, ExitStack, contextmanager
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from tsis.errors import RecordsError
from tsis.files import (
    DISK,
    EMPTY_CHAIN,
    Disk,
    LogChain,
    LogDraft,
    append_entries,
    exclusive_lock,
    file_error,
    printable_path,
    read_chain_file,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path


LOG_FILE = "log.jsonl"
CURE = "tsis study verify tells all"


def read_log(folder: Path, *, disk: Disk = DISK) -> LogChain:
    """Read the log of a study, damaged or not; `FileInputError` when it is missing or unreadable."""
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
    """Append entries to the log of a study, durably and exclusively, and return it; as `append_entries`.

    `RecordsError` when the log is damaged, or cannot be written.
    """
    path = folder / LOG_FILE
    with log_lock(folder):
        try:
            return append_entries(
                path, drafts_after, datetime.now(UTC), log_chain=log_chain, damaged=damaged, cure=CURE, disk=disk
            )
        except OSError as error:
            raise file_error(
                path, f"could not be written: {error.strerror or error}; earlier entries are unchanged", RecordsError
            ) from error


@contextmanager
def log_lock(path: Path, *, wait: bool = True) -> Iterator[None]:
    """Exclusive access to the log in the folder ``path``."""
    with ExitStack() as stack:
        try:
            stack.enter_context(exclusive_lock(path, wait=wait))
        except BlockingIOError as error:
            raise RecordsError(
                f"{printable_path(path.parent)} must be read by one run at a time; another one is under way (wait "
                "for it, or end it)"
            ) from error
        except OSError as error:
            raise RecordsError(f"{printable_path(path)} must be part of a study; got: {error.strerror}") from error
        yield


def run_lock(plan: Path) -> AbstractContextManager[None]:
    """Refuse while another run reads the targets of this ``plan``, a file that is never replaced."""
    return log_lock(plan, wait=False)
