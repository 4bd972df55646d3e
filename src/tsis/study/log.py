"""The log of a study on the disk: lines are added at its end, whole or not at all."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import TYPE_CHECKING

from tsis.instrument.file_bytes import printable_path, read_bytes
from tsis.model.durable import DISK, Disk, remove_unfinished, write_durably
from tsis.model.errors import RecordsError
from tsis.study.alone import log_lock
from tsis.study.chain import Chain, link_entries, read_chain

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from tsis.study.chain import Draft, Entry

LOG_FILE = "log.jsonl"


def read_log(folder: Path) -> Chain:
    """The log of a study as it is found.

    Raises
    ------
    FileInputError
        When there is none that can be read.
    """
    return read_chain(read_bytes(folder / LOG_FILE))


def append_log(
    folder: Path, drafts_after: Callable[[Chain], Sequence[Draft]], *, damaged: bool = False, disk: Disk = DISK
) -> tuple[Entry, ...]:
    """Add lines to the log; when this returns they are on the disk.

    The file is written anew under another name and then takes the place of the old one, so that no power loss leaves
    half a line. Nobody else adds lines meanwhile.

    Parameters
    ----------
    folder
        Of the study.
    drafts_after
        Given the log as it is at that moment, what to add; it may refuse by raising.
    damaged
        Whether lines may follow a log that does not fit.
    disk
        By which steps the file gets there.

    Raises
    ------
    RecordsError
        When the log does not fit, or cannot be written.
    """
    with log_lock(folder):
        content = read_bytes(folder / LOG_FILE)
        chain = read_chain(content)
        if chain.breaks and not damaged:
            line, wrong = min(chain.breaks.items())
            raise RecordsError(
                f"{printable_path(folder / LOG_FILE)} must be as it was written before anything is added; line {line} {wrong} "
                f"(tsis study verify tells all)"
            )
        entries = link_entries(chain, drafts_after(chain), datetime.now(UTC))
        if entries:
            added = "".join(f"{entry.line()}\n" for entry in entries).encode()
            _write(folder / LOG_FILE, content + (b"" if content.endswith(b"\n") else b"\n") + added, disk)
    return entries


def _write(path: Path, content: bytes, disk: Disk) -> None:
    try:
        write_durably(path, content, disk=disk)
    except OSError as error:
        raise RecordsError(
            f"{printable_path(path)} could not be written: {error.strerror or error}; what was entered before is as it was"
        ) from error
    remove_unfinished(path.parent)  # by others who were killed; nobody else writes here now


__all__ = ["LOG_FILE", "append_log", "read_log"]
