"""A log whose lines are bound to each other: each holds the hash of the one before, and its own."""

from __future__ import annotations

import json
import os
import sys
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from tsis.errors import RecordsError
from tsis.files import DISK, Disk, canonical, digest, printable_path, read_bytes, remove_unfinished, write_durably

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
    from pathlib import Path


FIRST = "0" * 64  # what stands before the first line
TEXTS = ("moment", "actor", "action", "previous", "hash")


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """A line of the log.

    Attributes
    ----------
    number
        From 1.
    moment
        When, ISO 8601 with its offset from UTC.
    actor
        Who.
    action
        What was done, e.g. ``"reading"``.
    content
        What of, plain values.
    previous, hash
        Hashes of the line before and of this one.
    """

    number: int
    moment: str
    actor: str
    action: str
    content: Mapping[str, Any]
    previous: str
    hash: str

    def line(self) -> str:
        """As the file holds it."""
        return canonical(self._plain())

    def _plain(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in ("number", "content", *TEXTS)}


@dataclass(frozen=True, slots=True, kw_only=True)
class Draft:
    """What is to become a line."""

    actor: str
    action: str
    content: Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Chain:
    """The lines of a log as they were found.

    Attributes
    ----------
    entries
        Those that can be read, in their order.
    lines
        Number of lines in the file.
    breaks
        What does not fit, by the number of the line.
    """

    entries: tuple[Entry, ...]
    lines: int
    breaks: Mapping[int, str]

    @property
    def head(self) -> str:
        """Hash of the last line that can be read."""
        return self.entries[-1].hash if self.entries else FIRST


def link_entries(chain: Chain, drafts: Iterable[Draft], moment: datetime) -> tuple[Entry, ...]:
    """Entries that follow a chain."""
    number, previous, entries = chain.lines, chain.head, list[Entry]()
    for draft in drafts:
        number += 1
        reference = {
            "number": number,
            "moment": moment.isoformat(),
            "actor": draft.actor,
            "action": draft.action,
            "content": json.loads(canonical(dict(draft.content))),  # as whoever reads the file gets it
            "previous": previous,
        }
        previous = digest(reference)
        entries.append(Entry(**reference, hash=previous))
    return tuple(entries)


def read_chain(content: bytes) -> Chain:
    r"""Read a log and find every line that does not fit.

    A change, addition or removal of any line shows here, but for two that the file alone cannot tell: lines cut off at
    the end, and a log that was written anew from some line to its end. A hash kept elsewhere shows them.

    Examples
    --------
    >>> from datetime import datetime
    >>> empty = Chain(entries=(), lines=0, breaks={})
    >>> drafts = [Draft(actor="me", action="said", content={"word": word}) for word in "ab"]
    >>> first, second = link_entries(empty, drafts, datetime(2026, 1, 1))
    >>> read_chain(f"{first.line()}\n{second.line()}\n".encode()).breaks
    {}
    >>> read_chain(f"{second.line()}\n".encode()).breaks
    {1: 'does not follow the line before it: lines were taken out, put in or moved'}
    """
    if not content:
        return Chain(entries=(), lines=0, breaks={})
    lines = content.split(b"\n")
    breaks: dict[int, str] = {}
    if lines[-1]:
        breaks[len(lines)] = "is cut short"
    else:
        lines.pop()
    entries: list[Entry] = []
    previous = FIRST
    for number, line in enumerate(lines, start=1):
        entry = _entry(line)
        if entry is None:
            breaks.setdefault(number, "cannot be read")
        else:
            wrong = _wrong(entry, line, number, previous)
            if wrong:
                breaks.setdefault(number, wrong)
            entries.append(entry)
        previous = previous if entry is None else entry.hash  # what is added follows the last line that can be read
    return Chain(entries=tuple(entries), lines=len(lines), breaks=breaks)


def _entry(line: bytes) -> Entry | None:
    try:
        reference = json.loads(line.decode())
        entry = Entry(**reference)
    except (ValueError, TypeError, RecursionError):
        return None
    texts = all(isinstance(getattr(entry, name), str) for name in TEXTS)
    return entry if texts and type(entry.number) is int and isinstance(entry.content, dict) else None


def _wrong(entry: Entry, line: bytes, number: int, previous: str) -> str:
    reference = {name: getattr(entry, name) for name in ("number", "content", *TEXTS) if name != "hash"}
    try:
        same = digest(reference) == entry.hash and entry.line().encode() == line
    except (TypeError, ValueError, RecursionError):  # numbers that no log holds, as NaN
        same = False
    if not same:
        return "was changed: its hash is not that of its content"
    if entry.number != number or entry.previous != previous:
        return "does not follow the line before it: lines were taken out, put in or moved"
    return ""


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
                f"{printable_path(folder / LOG_FILE)} must be as it was written before anything is added; "
                f"line {line} {wrong} "
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
            f"{printable_path(path)} could not be written: {error.strerror or error}; what was entered "
            f"before is as it was"
        ) from error
    remove_unfinished(path.parent)  # by others who were killed; nobody else writes here now
