"""What every benchmark shares: its options, the machine, tables and goals, peers in turns, and finished lines.

A benchmark is a module with its measurement and a `main` that begins and ends a `Bench`:

    bench = Bench(__doc__, seed=1, presses=500, protocol=Choice(PROTOCOLS, "domed"))
    bench.table("Errors", ("press", "error, %"), rows)
    return bench.end([Goal(name="median error, %", value=2.1, most=2.5)])

Options are named by keyword. A default of False is a switch, `Choice` lists names, a list or `Several` takes several
values, and a type stands for a value that is absent by default. Every benchmark takes ``--markdown``, which prints
tables as the pages have them, and ``--out FOLDER``, which writes each table as a CSV file and ``result.json`` with the
options, the machine, all tables and the goals. The exit code is 1 when a goal is missed.
"""

from __future__ import annotations

import argparse
import csv
import importlib
import importlib.metadata
import json
import math
import os
import platform
import re
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

import tsis

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

GOAL_HEADS = ("figure", "goal", "ours", "peer", "")
LIBRARIES = ("numpy", "scipy", "numba")
LEAST_S = 0.02  # a time is taken over as many calls as last this long
MOST_CALLS = 10_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Goal:
    """A measured number, its bounds (both included; none by default), and what a peer reaches.

    ``form`` says how a value is shown, as of `str.format`.
    """

    name: str
    value: float
    least: float = -math.inf
    most: float = math.inf
    form: str = "{:.1f}"
    peer: str = ""

    @property
    def met(self) -> bool:
        """Whether the value lies within its bounds; what is not a number does not."""
        unbounded = math.isinf(self.least) and math.isinf(self.most)
        return unbounded or self.least <= self.value <= self.most

    @property
    def shown(self) -> str:
        """The value as a text."""
        return self.form.format(self.value)

    @property
    def goal(self) -> str:
        """The bounds as a text; empty without any."""
        ends = ((">=", self.least), ("<=", self.most))
        return " and ".join(f"{sign} {self.form.format(end)}" for sign, end in ends if math.isfinite(end))

    @property
    def row(self) -> tuple[str, str, str, str, str]:
        """Its line of the table of goals."""
        return self.name, self.goal, self.shown, self.peer, ("met" if self.met else "missed") if self.goal else ""


class Bench:
    """One run of a benchmark: options read, tables printed and collected, goals judged."""

    def __init__(self, about: str | None, /, **options: Any) -> None:
        parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
        for name, default in options.items():
            parser.add_argument(f"--{name.replace('_', '-')}", **_argument(default))
        parser.add_argument("--markdown", action="store_true", help="print tables as Markdown")
        parser.add_argument("--out", type=Path, metavar="FOLDER", help="write tables and result.json there")
        self.options = parser.parse_args()
        self.machine = machine()
        self._tables: list[tuple[str, list[str], list[list[str]]]] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self.__dict__["options"], name)

    def table(self, title: str, heads: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
        """Print a table now, and write it at the end."""
        cells = [[str(cell) for cell in row] for row in rows]
        self._tables.append((title, list(heads), cells))
        show(title, heads, cells, markdown=self.options.markdown)

    def end(self, goals: Iterable[Goal] = ()) -> int:
        """Print the goals, the missed ones by name, and the machine; write the files; the exit code of the program."""
        judged = list(goals)
        if judged:
            self.table("Goals", GOAL_HEADS, [each.row for each in judged])
        missed = [each for each in judged if not each.met]
        for each in missed:
            print(f"missed: {each.name} is {each.shown}, its goal {each.goal}")
        print(sentence(self.machine | {"load_after": _load()}))
        if self.options.out is not None:
            self._write(judged)
        return int(bool(missed))

    def _write(self, goals: Sequence[Goal]) -> None:
        folder: Path = self.options.out
        folder.mkdir(parents=True, exist_ok=True)
        for title, heads, rows in self._tables:
            slug = re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")[:60]
            with (folder / f"{slug}.csv").open("w", newline="", encoding="utf-8") as file:
                csv.writer(file, lineterminator="\n").writerows([heads, *rows])
        document = {
            "options": vars(self.options),
            "machine": self.machine | {"load_after": _load()},
            "tables": [{"title": title, "heads": heads, "rows": rows} for title, heads, rows in self._tables],
            "goals": [{"name": each.name, "value": each.value, "goal": each.goal, "met": each.met} for each in goals],
        }
        (folder / "result.json").write_text(json.dumps(document, indent=1, default=str) + "\n", encoding="utf-8")


@dataclass(frozen=True, slots=True)
class Several:
    """An option that may be given several values, of ``names`` where there are any; empty by default."""

    names: Iterable[object] | None = None
    kind: type = str


@dataclass(frozen=True, slots=True)
class Choice:
    """An option that takes one of ``names``."""

    names: Iterable[str]
    default: str | None = None


def _argument(default: Any) -> dict[str, Any]:
    if isinstance(default, Several):
        choices = None if default.names is None else list(default.names)
        return {"nargs": "+", "action": "extend", "choices": choices, "type": default.kind, "default": []}
    if default is False:
        return {"action": "store_true"}
    if isinstance(default, type):
        return {"type": default, "default": None}
    if isinstance(default, Choice):
        return {"choices": list(default.names), "default": default.default}
    if isinstance(default, list):
        return {"nargs": "+", "type": type(default[0]) if default else str, "default": default}
    return {"type": type(default), "default": default}


def show(title: str, heads: Sequence[str], rows: Iterable[Sequence[str]], *, markdown: bool = False) -> None:
    """Print a table to standard output."""
    if markdown:
        lines = [heads, ["---"] * len(heads), *rows]
        print(f"{title}\n\n" + "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n")
        return
    table = Table(title=title, title_justify="left")
    for head in heads:
        table.add_column(head)
    for row in rows:
        table.add_row(*row)
    Console(highlight=False).print(table)


def machine() -> dict[str, Any]:
    """Processor, cores that this process may use, load (processes a minute that wanted a core), versions, date."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    versions = {"tsis": tsis.__version__, "Python": platform.python_version(), **{k: version(k) for k in LIBRARIES}}
    return {
        "processor": _processor(),
        "cores": cores,
        "load": _load(),
        "versions": versions,
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def sentence(here: dict[str, Any]) -> str:
    """The machine in words."""
    versions = ", ".join(f"{name} {each}" for name, each in here["versions"].items() if each)
    load = f"load {here['load']:.1f} before and {here['load_after']:.1f} after"
    return f"{here['processor']}, {here['cores']} cores, {load}, {here['date'][:10]}. {versions}."


def _load() -> float:
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")


def _processor() -> str:
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def version(name: str) -> str | None:
    """Version of a distribution; None where it is not installed."""
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None


def missing(package: str, module: str | None = None) -> str:
    """Why a peer cannot take part; empty where it can."""
    try:
        importlib.import_module(module or package)
    except ModuleNotFoundError as error:
        return f"{error.name} is not installed"
    except Exception as error:  # libraries that want other libraries fail in any way
        return f"{package} cannot be loaded: {error!s:.80}"
    return ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """A folder for files, on the disk that is measured, and the Python of peers that run by themselves."""

    folder: Path
    peer_python: str

    @property
    def cores(self) -> int:
        """Number of processors that may be used."""
        return int(machine()["cores"])


def duration(seconds: float) -> str:
    """Seconds in the unit that suits them.

    Examples
    --------
    >>> duration(0.0123), duration(75.0)
    ('12.3 ms', '75 s')
    """
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"


def counted(counts: Mapping[str, int]) -> str:
    """Counts by name in words, the most frequent first."""
    return ", ".join(f"{name} {number}" for name, number in sorted(counts.items(), key=lambda each: -each[1])) or "none"


@dataclass(frozen=True, slots=True, kw_only=True)
class Side:
    """One program at a task: its name and version, a call that returns its seconds, and what its answer is worth."""

    program: str
    seconds: Callable[[], float]
    note: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Contest:
    """The same task by tsis and by others; ``absent`` has programs that would take part, and why they do not."""

    task: str
    own: Side
    peers: tuple[Side, ...] = ()
    absent: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One task by tsis and one peer: seconds of each turn, none where the peer did not run; a note on the answers."""

    task: str
    own_s: tuple[float, ...]
    peer: str
    peer_s: tuple[float, ...] = ()
    note: str = ""

    @property
    def ratios(self) -> tuple[float, ...]:
        """The peer's time over ours, turn by turn."""
        return tuple(peer / own for own, peer in zip(self.own_s, self.peer_s, strict=True)) if self.peer_s else ()

    @property
    def ratio(self) -> float | None:
        """How many times as long the peer takes: median of the turns; below 1 it is the faster one."""
        return median(self.ratios) if self.ratios else None


def in_turns(contest: Contest, turns: int = 5) -> list[Row]:
    """Let all programs do the work ``turns`` times, every other turn in the opposite order; a row a peer.

    Whatever else the machine does meets all of them alike.
    """
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
    """A function that returns the seconds of a call.

    Unless the work is timed ``once``, as it is, a first call compiles and fills caches and is not counted, and short
    calls are repeated.
    """
    calls = 1 if once else 0

    def seconds() -> float:
        nonlocal calls
        if not calls:
            call()
            calls = _enough_calls(call, clock)
        began = clock()
        for _ in range(calls):
            call()
        return (clock() - began) / calls

    return seconds


def _enough_calls(call: Callable[[], object], clock: Callable[[], float]) -> int:
    began = clock()
    call()
    once = clock() - began
    return MOST_CALLS if once <= 0 else max(1, min(MOST_CALLS, round(LEAST_S / once)))


def read_lines(path: Path | None, key: str) -> dict[Any, dict[str, Any]]:
    """Finished lines of an interrupted run by their ``key``, without one that was cut off."""
    found = {}
    for text in path.read_text().splitlines() if path is not None and path.exists() else ():
        with suppress(json.JSONDecodeError):
            line = json.loads(text)
            found[line[key]] = line
    return found


def append_line(path: Path | None, line: dict[str, Any]) -> None:
    """Append a finished line of JSON, where lines are kept."""
    if path is None:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a") as file:
        file.write(f"\n{json.dumps(line)}")  # the break comes first: half a line stays a line of its own
