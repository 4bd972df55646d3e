"""An append-only hash-chained log: each entry contains the hash of the previous one, and its own."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from tsis.errors import RecordsError
from tsis.files.atomic import DISK, Disk, append_durably
from tsis.files.canonical_json import canonical, digest, digest_or_none
from tsis.files.reading import file_error, read_bytes

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence
    from datetime import datetime
    from pathlib import Path


CUT_SHORT = "is cut short"
FIRST_HASH = "0" * 64  # the previous hash of the first entry
TEXTS = ("moment", "actor", "action", "previous", "hash")


def linked_entry(entry: Mapping[str, Any], number: int, previous: str) -> dict[str, Any]:
    """An entry with its number, the previous hash, and its own hash over all fields.

    Examples
    --------
    >>> entry = linked_entry({"action": "created"}, 1, FIRST_HASH)
    >>> link_faults(entry, 1, FIRST_HASH), link_faults(entry | {"action": "edited"}, 1, FIRST_HASH)
    ((), ('hash',))
    """
    whole = {**entry, "number": number, "previous": previous}
    return whole | {"hash": digest(whole)}


def link_faults(entry: Mapping[str, Any], number: int, previous: str) -> tuple[str, ...]:
    """Those of ``"number"``, ``"previous"`` and ``"hash"`` that do not fit the position in the chain."""
    hashed = digest_or_none({name: value for name, value in entry.items() if name != "hash"})
    expected = {"number": number, "previous": previous, "hash": hashed}
    return tuple(name for name, value in expected.items() if entry[name] != value or value is None)


@dataclass(frozen=True, slots=True, kw_only=True)
class LogEntry:
    """An entry of the log: its position from 1, the time in ISO 8601 with its offset from UTC, the user, the event.

    ``content`` has JSON values; ``previous`` and ``hash`` are those of the previous entry and of this one.
    """

    number: int
    moment: str
    actor: str
    action: str
    content: Mapping[str, Any]
    previous: str
    hash: str

    def line(self) -> str:
        """The line of the file."""
        return canonical(self.to_json())

    def to_json(self) -> dict[str, Any]:
        """The fields by name."""
        return {name: getattr(self, name) for name in ("number", "content", *TEXTS)}


@dataclass(frozen=True, slots=True, kw_only=True)
class LogDraft:
    """An entry without its position in the log."""

    actor: str
    action: str
    content: Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class LogChain:
    """The lines of a log: readable entries, number of lines, faults by line, and bytes of the complete lines."""

    entries: tuple[LogEntry, ...] = ()
    lines: int = 0
    breaks: Mapping[int, str] = field(default_factory=dict)
    size: int = 0

    @property
    def head(self) -> str:
        """Hash of the last readable line."""
        return self.entries[-1].hash if self.entries else FIRST_HASH


EMPTY_CHAIN = LogChain()


def link_entries(chain: LogChain, drafts: Iterable[LogDraft], moment: datetime) -> tuple[LogEntry, ...]:
    """Entries that follow a chain."""
    number, previous, entries = chain.lines, chain.head, list[LogEntry]()
    for draft in drafts:
        number += 1
        content = json.loads(canonical(dict(draft.content)))  # as a reader of the file gets it
        document = {"moment": moment.isoformat(), "actor": draft.actor, "action": draft.action, "content": content}
        entries.append(LogEntry(**linked_entry(document, number, previous)))
        previous = entries[-1].hash
    return tuple(entries)


def read_chain(content: bytes, after: LogChain = EMPTY_CHAIN) -> LogChain:
    r"""Read a log and report every line that does not fit.

    This detects any change, addition or removal of a line, except a truncated end and an end that was rewritten. A copy
    of the last hash elsewhere detects these.

    Parameters
    ----------
    content
        The log, or its part after the lines of ``after``.
    after
        The lines before.

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
            continue  # later lines are linked to the last readable line
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
        faults = link_faults(entry.to_json(), number, previous)
        same = "hash" not in faults and entry.line().encode() == line
    except (ValueError, RecursionError):
        same = False
    if not same:
        return "was changed: its hash is not that of its content"
    return "does not follow the line before it: lines were taken out, put in or moved" if faults else ""


def read_chain_file(path: Path, log_chain: LogChain = EMPTY_CHAIN, *, disk: Disk = DISK) -> LogChain:
    """The log of a file, or `FileInputError`.

    Where the file still has the last line of ``log_chain``, only the rest is read; this does not detect a change before
    that line.
    """
    if log_chain.entries and not log_chain.breaks:
        last = f"{log_chain.entries[-1].line()}\n".encode()
        try:
            end = disk.read_from(path, log_chain.size - len(last))
        except OSError as error:
            raise file_error(path, f"must be a file that can be read; got: {error}") from error
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
    """Append entries to a log durably and return it; the caller must be the only writer.

    A truncated line at the end, which a power loss leaves of an unconfirmed append, is removed.

    Parameters
    ----------
    path
        The file.
    drafts_after
        Returns the entries to append after the present log; may raise to refuse.
    moment
        Time of the entries, with its offset from UTC.
    log_chain
        The log of an earlier reading, which makes the cost independent of its length.
    damaged
        Whether to append to a damaged log.
    cure
        Advice in the error on a damaged log.
    disk
        Write operations, which tests replace.

    Raises
    ------
    FileInputError
        When the log is unreadable.
    RecordsError
        When it is damaged.
    OSError
        When it cannot be written; it is then as before.
    """
    chain = read_chain_file(path, log_chain, disk=disk)
    torn = {line for line, wrong in chain.breaks.items() if wrong == CUT_SHORT}
    if not damaged and set(chain.breaks) == torn:
        chain = LogChain(entries=chain.entries, lines=chain.lines - len(torn), size=chain.size)
    if chain.breaks and not damaged:
        line, wrong = min(chain.breaks.items())
        raise file_error(
            path, f"must be as it was written before anything is added; line {line} {wrong} ({cure})", RecordsError
        )
    added = "".join(f"{entry.line()}\n" for entry in link_entries(chain, drafts_after(chain), moment)).encode()
    if not added:
        return chain
    if chain.breaks:  # a truncated line stays as a separate line
        append_durably(path, b"\n" * len(torn) + added, disk=disk)
        return read_chain(read_bytes(path))
    append_durably(path, added, after=chain.size, disk=disk)
    return read_chain(added, chain)
