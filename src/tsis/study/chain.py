"""A log whose lines are bound to each other: each holds the hash of the one before, and its own."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from tsis.records.canonical import canonical, digest

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from datetime import datetime

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
        plain = {
            "number": number,
            "moment": moment.isoformat(),
            "actor": draft.actor,
            "action": draft.action,
            "content": json.loads(canonical(dict(draft.content))),  # as whoever reads the file gets it
            "previous": previous,
        }
        previous = digest(plain)
        entries.append(Entry(**plain, hash=previous))
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
        plain = json.loads(line.decode())
        entry = Entry(**plain)
    except (ValueError, TypeError, RecursionError):
        return None
    texts = all(isinstance(getattr(entry, name), str) for name in TEXTS)
    return entry if texts and type(entry.number) is int and isinstance(entry.content, dict) else None


def _wrong(entry: Entry, line: bytes, number: int, previous: str) -> str:
    plain = {name: getattr(entry, name) for name in ("number", "content", *TEXTS) if name != "hash"}
    try:
        same = digest(plain) == entry.hash and entry.line().encode() == line
    except (TypeError, ValueError, RecursionError):  # numbers that no log holds, as NaN
        same = False
    if not same:
        return "was changed: its hash is not that of its content"
    if entry.number != number or entry.previous != previous:
        return "does not follow the line before it: lines were taken out, put in or moved"
    return ""


__all__ = ["FIRST", "Chain", "Draft", "Entry", "link_entries", "read_chain"]
