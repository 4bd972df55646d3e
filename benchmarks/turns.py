"""Several programs at the same work, in turns, so that whatever else the machine does meets all of them alike."""

from __future__ import annotations

from dataclasses import dataclass, field
from statistics import median
from time import perf_counter
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

LEAST_S = 0.02  # a time is taken over as many calls as last this long
MOST_CALLS = 10_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Side:
    """One program.

    Attributes
    ----------
    program
        Its name and version.
    seconds
        Does the work once or often, and tells the seconds that once takes.
    note
        What its answer is worth, in few words.
    """

    program: str
    seconds: Callable[[], float]
    note: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Contest:
    """The same work by tsis and by others.

    Attributes
    ----------
    task
        The work, in words.
    own, peers
        Who does it.
    absent
        Programs that would, and why they do not run here.
    """

    task: str
    own: Side
    peers: tuple[Side, ...] = ()
    absent: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A line of the table: one task, and one program beside tsis.

    Attributes
    ----------
    task
        The work.
    own_s, peer_s
        Seconds of each turn; ``peer_s`` is empty where the peer did not run.
    peer
        The other program.
    note
        What the answers are worth, or why there is no peer.
    """

    task: str
    own_s: tuple[float, ...]
    peer: str
    peer_s: tuple[float, ...] = ()
    note: str = ""
    ratios: tuple[float, ...] = field(init=False)

    def __post_init__(self) -> None:
        pairs = zip(self.own_s, self.peer_s, strict=True) if self.peer_s else ()
        object.__setattr__(self, "ratios", tuple(peer / own for own, peer in pairs))

    @property
    def ratio(self) -> float | None:
        """How many times as long the other program takes: median of the turns; below 1 it is the faster one."""
        return median(self.ratios) if self.ratios else None


def in_turns(contest: Contest, turns: int = 5) -> list[Row]:
    """Let all programs do the work ``turns`` times, every other turn in the opposite order; a row a peer."""
    sides = (contest.own, *contest.peers)
    taken: list[list[float]] = [[] for _ in sides]
    for turn in range(turns):
        order = range(len(sides)) if turn % 2 == 0 else reversed(range(len(sides)))
        for number in order:
            taken[number].append(sides[number].seconds())
    own, *others = (tuple(each) for each in taken)
    notes = [", ".join(filter(None, (contest.own.note, peer.note))) for peer in contest.peers]
    rows = [
        Row(task=contest.task, own_s=own, peer=peer.program, peer_s=seconds, note=note)
        for peer, seconds, note in zip(contest.peers, others, notes, strict=True)
    ]
    return rows + [Row(task=contest.task, own_s=own, peer=program, note=reason) for program, reason in contest.absent]


def timed(
    call: Callable[[], object], *, once: bool = False, clock: Callable[[], float] = perf_counter
) -> Callable[[], float]:
    """Seconds of a call.

    Parameters
    ----------
    call
        The work. Unless it is ``once``, a first call compiles and fills what is remembered and is not counted, and
        short calls are repeated.
    once
        Time a single call as it is, for work of seconds.
    clock
        Tells the time, s.
    """
    calls = 1 if once else 0

    def seconds() -> float:
        nonlocal calls
        if not calls:
            call()
            calls = _calls_of(call, clock)
        began = clock()
        for _ in range(calls):
            call()
        return (clock() - began) / calls

    return seconds


def _calls_of(call: Callable[[], object], clock: Callable[[], float]) -> int:
    """How many calls last long enough."""
    began = clock()
    call()
    once = clock() - began
    return MOST_CALLS if once <= 0 else max(1, min(MOST_CALLS, round(LEAST_S / once)))
