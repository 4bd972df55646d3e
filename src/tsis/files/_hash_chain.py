"""An append-only log whose entries are bound to each other: each contains the hash of the one before, and its own."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from tsis.errors import FileInputError, RecordsError
from tsis.files._atomic import DISK, Disk, append_durably
from tsis.files._json import canonical, digest, digest_or_none
from tsis.files._reading import printable_path, read_bytes

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence
    from datetime import datetime
    from pathlib import Path


CUT_SHORT = "is cut short"
FIRST_HASH = "0" * 64  # the previous hash of the first entry
TEXTS = ("moment", "actor", "action", "previous", "hash")


def linked_entry(entry: Mapping[str, Any], number: int, previous: str) -> dict[str, Any]:
    """An entry with its number, the hash of the entry before it, and its own hash, which covers all of them.

    Examples
    --------
    >>> entry = linked_entry({"action": "created"}, 1, FIRST_HASH)
    >>> link_faults(entry, 1, FIRST_HASH), link_faults(entry | {"action": "edited"}, 1, FIRST_HASH)
    ((), ('hash',))
    """
    whole = {**entry, "number": number, "previous": previous}
    return whole | {"hash": digest(whole)}


def link_faults(entry: Mapping[str, Any], number: int, previous: str) -> tuple[str, ...]:
    """Which of ``"number"``, ``"previous"`` and ``"hash"`` do not fit an entry at its place in the chain."""
    hashed = digest_or_none({name: value for name, value in entry.items() if name != "hash"})
    expected = {"number": number, "previous": previous, "hash": hashed}
    return tuple(name for name, value in expected.items() if entry[name] != value or value is None)


@dataclass(frozen=True, slots=True, kw_only=True)
class LogEntry:
    """An entry of the log.

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
        Hashes of the entry before and of this one.
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
        return canonical(self.plain())

    def plain(self) -> dict[str, Any]:
        """Its fields by name."""
        return {name: getattr(self, name) for name in ("number", "content", *TEXTS)}


@dataclass(frozen=True, slots=True, kw_only=True)
class LogDraft:
    """An entry without its place in the log."""

    actor: str
    action: str
    content: Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class LogChain:
    """The lines of a log as they were read.

    Attributes
    ----------
    entries
        Those that can be read, in their order.
    lines
        Number of lines in the file.
    breaks
        What does not fit, by the number of the line.
    size
        Bytes of the complete lines.
    """

    entries: tuple[LogEntry, ...] = ()
    lines: int = 0
    breaks: Mapping[int, str] = field(default_factory=dict)
    size: int = 0

    @property
    def head(self) -> str:
        """Hash of the last line that can be read."""
        return self.entries[-1].hash if self.entries else FIRST_HASH


EMPTY_CHAIN = LogChain()


def link_entries(chain: LogChain, drafts: Iterable[LogDraft], moment: datetime) -> tuple[LogEntry, ...]:
    """Entries that follow a chain."""
    number, previous, entries = chain.lines, chain.head, list[LogEntry]()
    for draft in drafts:
        number += 1
        content = json.loads(canonical(dict(draft.content)))  # as whoever reads the file gets it
        document = {"moment": moment.isoformat(), "actor": draft.actor, "action": draft.action, "content": content}
        entries.append(LogEntry(**linked_entry(document, number, previous)))
        previous = entries[-1].hash
    return tuple(entries)


def read_chain(content: bytes, after: LogChain = EMPTY_CHAIN) -> LogChain:
    r"""Read a log and find every line that does not fit.

    A change, addition or removal of any line shows here, but for two that the file alone cannot tell: lines cut off at
    the end, and a log that was written anew from some line to its end. A hash that was noted elsewhere shows them.

    Parameters
    ----------
    content
        The log, or what follows the lines of ``after`` in it.
    after
        The lines that were read before.

    Examples
    --------
    >>> from datetime import datetime
    >>> drafts = [LogDraft(actor="me", action="said", content={"word": word}) for word in "ab"]
    >>> first, second = link_entries(EMPTY_CHAIN, drafts, datetime(2026, 1, 1))
    >>> read_chain(f"{first.line()}\n{second.line()}\n".encode()).breaks
    {}
    >>> read_chain(f"{second.line()}\n".encode()).breaks
    {1: 'does not follow the line before it: lines were taken out, put in or moved'}
    """
    if not content:
        return after
    lines, breaks, entries, previous = content.split(b"\n"), dict(after.breaks), list(after.entries), after.head
    last = after.lines + len(lines)
    size = after.size + len(content) - len(lines[-1])
    if lines[-1]:
        breaks[last] = CUT_SHORT
    else:
        lines.pop()
        last -= 1
    for number, line in enumerate(lines, start=after.lines + 1):
        entry = _entry(line)
        if entry is None:
            breaks.setdefault(number, "cannot be read")
            continue  # what follows is linked to the last line that can be read
        if wrong := _wrong(entry, line, number, previous):
            breaks.setdefault(number, wrong)
        entries.append(entry)
        previous = entry.hash
    return LogChain(entries=tuple(entries), lines=last, breaks=breaks, size=size)


def _entry(line: bytes) -> LogEntry | None:
    try:
        entry = LogEntry(**json.loads(line.decode()))
    except (ValueError, TypeError, RecursionError):
        return None
    texts = all(isinstance(getattr(entry, name), str) for name in TEXTS)
    return entry if texts and type(entry.number) is int and isinstance(entry.content, dict) else None


def _wrong(entry: LogEntry, line: bytes, number: int, previous: str) -> str:
    try:
        faults = link_faults(entry.plain(), number, previous)
        same = "hash" not in faults and entry.line().encode() == line
    except (ValueError, RecursionError):
        same = False
    if not same:
        return "was changed: its hash is not that of its content"
    return "does not follow the line before it: lines were taken out, put in or moved" if faults else ""


def read_chain_file(path: Path, log_chain: LogChain = EMPTY_CHAIN, *, disk: Disk = DISK) -> LogChain:
    """The log of a file; what follows ``log_chain`` alone is read where the file still has the last line of it.

    A change before that line shows when the file is read without ``log_chain``.

    Raises
    ------
    FileInputError
        When there is no file that can be read.
    """
    if log_chain.entries and not log_chain.breaks:
        last = f"{log_chain.entries[-1].line()}\n".encode()
        try:
            end = disk.read_from(path, log_chain.size - len(last))
        except OSError as error:
            raise FileInputError(f"{printable_path(path)} must be a file that can be read; got: {error}") from error
        if end.startswith(last):
            return read_chain(end[len(last) :], log_chain)
    return read_chain(read_bytes(path))


def append_entries(
    path: Path,
    drafts_after: Callable[[LogChain], Sequence[LogDraft]],
    moment: datetime,
    *,
    log_chain: LogChain = EMPTY_CHAIN,
    damaged: bool = False,
    cure: str,
    disk: Disk = DISK,
) -> LogChain:
    """Append entries to a log and return it; they are on the disk by then. Nobody else may write it meanwhile.

    A line that is cut short at the end is what a power loss leaves of an append that did not return; it is removed.

    Parameters
    ----------
    path
        The file.
    drafts_after
        Given the log as it is at that moment, what to append; it may refuse by raising.
    moment
        When they are appended, with its offset from UTC.
    log_chain
        The log as it was read before: then the cost does not depend on its length.
    damaged
        Whether entries may follow a log that does not fit.
    cure
        What the error of a log that does not fit advises.
    disk
        By which steps they get onto the disk.

    Raises
    ------
    FileInputError
        When the log cannot be read.
    RecordsError
        When it does not fit.
    OSError
        When it cannot be written; then it is as it was.
    """
    chain = read_chain_file(path, log_chain, disk=disk)
    torn = {line for line, wrong in chain.breaks.items() if wrong == CUT_SHORT}
    if not damaged and set(chain.breaks) == torn:
        chain = LogChain(entries=chain.entries, lines=chain.lines - len(torn), size=chain.size)
    if chain.breaks and not damaged:
        line, wrong = min(chain.breaks.items())
        raise RecordsError(
            f"{printable_path(path)} must be as it was written before anything is added; line {line} {wrong} ({cure})"
        )
    added = "".join(f"{entry.line()}\n" for entry in link_entries(chain, drafts_after(chain), moment)).encode()
    if not added:
        return chain
    if chain.breaks:  # the rest of a line that is cut short stays, as a line of its own
        append_durably(path, b"\n" * len(torn) + added, disk=disk)
        return read_chain(read_bytes(path))
    append_durably(path, added, after=chain.size, disk=disk)
    return read_chain(added, chain)
