"""What a disk may hold after power was lost: every step by which files get onto it, recorded, and states made of them.

The promises are the weakest sensible ones. Of what was written to a file and not synced anything may be there: nothing,
a part, blocks of zeros, blocks of something else. Each name that was given, taken or changed in a folder and not synced
may be there or not, independently of all others; a name that was given to another file by renaming may also be lost.
What `Disk.sync` returned for lasts without its name, what `Disk.sync_folder` returned for are the names in that folder.
A commit lasts when it returned if the connection itself says that it syncs; otherwise any earlier one may come back.
"""

from __future__ import annotations

import hashlib
import itertools
import random
import sqlite3
import sys
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from functools import cache, lru_cache
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any
from unittest import mock

from tsis.model.durable import Disk
from tsis.records.database import Database

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator

BLOCK = 512
FOLDER = -1  # what a name stands for besides files, which are numbered
SYNCS = ("sync", "sync_folder")


class Killed(BaseException):
    """The program is gone, before its next step."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """One step, with where in the program it was taken; paths are relative to the root of the recorded disk."""

    kind: str
    site: str = ""
    path: str = ""
    to: str = ""
    file: int = 0
    content: bytes = b""
    value: Any = None  # of a commit whether it lasts, of an acknowledgement what was acknowledged


@dataclass
class Trace:
    """Steps in their order, by however many programs, and the database after each commit."""

    root: Path
    steps: list[Step] = field(default_factory=list)
    commits: list[bytes] = field(default_factory=lambda: [b""])
    files: dict[str, int] = field(default_factory=dict)  # which file has a name while programs run
    numbers: Iterator[int] = field(default_factory=itertools.count)

    def relative(self, path: Path) -> str | None:
        """The path below the root; None for one that lies elsewhere."""
        path = path.absolute()
        return str(path.relative_to(self.root)) if path.is_relative_to(self.root) else None


class RecordingDisk(Disk):
    """Takes every step really, and records it.

    Parameters
    ----------
    trace
        To which steps are added.
    kill_at
        Before which of its steps the program is gone; never by default.
    before
        Called before each step, as where two programs take turns.
    """

    def __init__(self, trace: Trace, *, kill_at: int | None = None, before: Callable[[], None] | None = None) -> None:
        self.trace, self._left, self._before = trace, kill_at, before
        self.turns = 0

    def create(self, path: Path) -> IO[bytes]:
        self._turn()
        opened = super().create(path)
        self.trace.files[str(path)] = number = next(self.trace.numbers)
        self._add("create", path, file=number)
        return opened

    def write(self, file: IO[bytes], content: bytes) -> None:
        self._turn()
        super().write(file, content)
        self._add("write", Path(file.name), file=self.trace.files[file.name], content=content)

    def sync(self, file: IO[bytes]) -> None:
        self._turn()
        super().sync(file)
        self.adopt(Path(file.name))
        self._add("sync", Path(file.name), file=self.trace.files[file.name])

    def rename(self, draft: Path, path: Path) -> None:
        self._turn()
        self.adopt(draft)
        super().rename(draft, path)
        self.trace.files[str(path)] = number = self.trace.files.pop(str(draft))
        self._add("rename", draft, to=str(self.trace.relative(path)), file=number)

    def name(self, draft: Path, path: Path) -> None:
        self._turn()
        super().name(draft, path)
        self.trace.files[str(path)] = number = self.trace.files.pop(str(draft))
        self._add("name", draft, to=str(self.trace.relative(path)), file=number)

    def sync_folder(self, folder: Path) -> None:
        if self.trace.relative(folder) is not None:
            self._turn()
            super().sync_folder(folder)
            self._add("sync_folder", folder)

    def make_folder(self, folder: Path) -> None:
        self._turn()
        new = not folder.exists()
        super().make_folder(folder)
        if new:
            self._add("make_folder", folder)

    def remove(self, path: Path) -> None:
        self._turn()
        super().remove(path)
        self._add("remove", path)

    def _turn(self) -> None:
        self.turns += 1
        if self._before is not None:
            self._before()
        if self._left is not None:
            if self._left == 0:
                raise Killed
            self._left -= 1

    def adopt(self, path: Path) -> None:
        """Take note of a file that somebody wrote by other steps, and never synced."""
        if str(path) not in self.trace.files:
            self.trace.files[str(path)] = number = next(self.trace.numbers)
            self._add("create", path, file=number)
            self._add("write", path, file=number, content=path.read_bytes())

    def _add(self, kind: str, path: Path, **values: Any) -> None:
        relative = self.trace.relative(path)
        self.trace.steps.append(Step(kind=kind, path=str(relative), site=_site(kind), **values))


def _site(kind: str) -> str:
    """Which functions of the program took the step, the outermost of its storing first."""
    names: list[str] = []
    frame = sys._getframe(3)
    while frame is not None and len(names) < 3:
        if frame.f_globals.get("__name__", "").startswith("tsis."):
            names.append(frame.f_code.co_qualname)
            if not frame.f_globals["__name__"].endswith(".durable"):
                break
        frame = frame.f_back  # type: ignore[assignment]
    return " > ".join([*(name for name in reversed(names) if not name.startswith("Disk.")), kind])


@lru_cache(maxsize=100_000)
def sha256(content: bytes) -> str:
    """Hash of what a file holds, worked out once."""
    return hashlib.sha256(content).hexdigest()


@cache
def _parent(path: str) -> str:
    return str(Path(path).parent)


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """What a disk may hold: bytes by path, folders, and which commit the database is at (-1: it is not there)."""

    files: dict[str, bytes]
    folders: frozenset[str]
    commit: int

    def key(self) -> bytes:
        """Equal for equal states only."""
        files = sorted((path, sha256(content)) for path, content in self.files.items())
        return hashlib.sha256(repr((sorted(self.folders), self.commit, files)).encode()).digest()


class Playback:
    """The disk after the first steps of a trace, of which some syncs did nothing.

    Parameters
    ----------
    trace
        What was recorded.
    skipped
        Numbers of the syncs that did nothing.
    database
        Folder that the database lies in.
    """

    def __init__(self, trace: Trace, *, skipped: Collection[int] = (), database: str) -> None:
        self._trace, self._skipped, self._database = trace, skipped, database
        self.names: dict[str, list[int | None]] = {}  # what each may stand for: what lasts, then the pending ones
        self._written: dict[int, bytes] = {}
        self._synced: dict[int, bytes] = {}
        self._lasting_commit, self._commit, self.taken = 0, 0, 0
        self._known: dict[tuple[int, int], bytes] = {}

    def step(self) -> None:
        """Take the next step of the trace."""
        step = self._trace.steps[self.taken]
        skipped = self.taken in self._skipped
        self.taken += 1
        if step.kind == "create":
            self._written[step.file] = b""
            self._name(step.path).append(step.file)
        elif step.kind == "write":
            self._written[step.file] += step.content
        elif step.kind == "sync" and not skipped:
            self._synced[step.file] = self._written[step.file]
        elif step.kind == "rename":
            self._name(step.path).append(None)
            over = self._name(step.to)
            over += [None, step.file] if over[-1] is not None else [step.file]
        elif step.kind == "name":
            self._name(step.path).append(None)
            self._name(step.to).append(step.file)
        elif step.kind == "make_folder":
            self._name(step.path).append(FOLDER)
        elif step.kind == "remove":
            self._name(step.path).append(None)
        elif step.kind == "sync_folder" and not skipped:
            for path, values in self.names.items():
                if _parent(path) == step.path:
                    del values[:-1]
        elif step.kind == "commit":
            self._commit += 1
            if step.value:
                self._lasting_commit = self._commit

    def _name(self, path: str) -> list[int | None]:
        return self.names.setdefault(path, [None])

    def systematic(self) -> Iterator[State]:
        """All pending there, none, and each single one otherwise than the rest."""
        unsure = sorted({path for path, values in self.names.items() if len(values) > 1})
        for rest in (-1, 0):
            yield self._state({}, rest, None, rest)
            for path in unsure:
                for which in range(len(self.names[path])):
                    yield self._state({path: which}, rest, None, -1)
        for damage in range(4):
            yield self._state({}, -1, damage, -1)
        yield self._state({}, -1, None, 0)

    def drawn(self, rng: random.Random) -> State:
        """One at random."""
        few = rng.random() < 0.5  # most of the rest there: what is lost alone hurts most
        chosen = {
            path: rng.randrange(len(values))
            for path, values in self.names.items()
            if len(values) > 1 and (not few or rng.random() < 0.2)
        }
        return self._state(chosen, -1, rng.randrange(1, 2**20), rng.choice((-1, 0)))

    def _state(self, chosen: dict[str, int], rest: int, damage: int | None, commit: int) -> State:
        folders: set[str] = set()
        files: dict[str, bytes] = {}
        for path in sorted(self.names):  # folders come before what is in them
            value = self.names[path][chosen.get(path, rest)]
            parent = _parent(path)
            if value is None or (parent != "." and parent not in folders):
                continue
            if value == FOLDER:
                folders.add(path)
            else:
                files[path] = self._content(value, damage)
        at = -1
        if self._database == "." or self._database in folders:
            following = self._trace.steps[self.taken].kind if self.taken < len(self._trace.steps) else ""
            last = self._commit + (following == "commit")  # it may have reached the disk before it returned
            at = last if commit == -1 else self._lasting_commit
        return State(files=files, folders=frozenset(folders), commit=at)

    def _content(self, file: int, damage: int | None) -> bytes:
        written = self._written[file]
        if self._synced.get(file) == written or damage is None:
            return written
        if (file, damage) not in self._known:
            self._known[file, damage] = damaged(written, damage, file)
        return self._known[file, damage]


def damaged(content: bytes, damage: int, salt: int) -> bytes:
    """What may be on the disk of a file that was not synced: 0 nothing, 1 half, 2 zeros, 3 garbage, above at random."""
    rng = random.Random(1_000_003 * salt + damage)
    if damage <= 1:
        return content[: damage * len(content) // 2]
    blocks = [content[i : i + BLOCK] for i in range(0, len(content), BLOCK)]
    if damage == 2:
        return bytes(len(content))
    if damage == 3:
        return rng.randbytes(len(content))
    kind = rng.randrange(4)
    if kind == 0:
        return content
    if kind == 1:
        return content[: rng.randrange(len(content) + 1)]
    odd = bytes if kind == 2 else rng.randbytes
    return b"".join(odd(len(block)) if rng.random() < 0.4 else block for block in blocks)


@contextmanager
def recorded_commits(trace: Trace) -> Iterator[None]:
    """Record every commit of a store, with whether its own connection says that it lasts."""
    original = Database.writing

    @contextmanager
    def writing(self: Database) -> Iterator[Any]:
        assert self.file is not None
        with original(self) as connection:
            yield connection
            journal = connection.exec_driver_sql("PRAGMA journal_mode").scalar_one()
            synchronous = connection.exec_driver_sql("PRAGMA synchronous").scalar_one()
        with closing(sqlite3.connect(self.file)) as reading:
            trace.commits.append(reading.serialize())
        lasts = synchronous >= 2 and journal in ("wal", "delete", "truncate", "persist")
        trace.steps.append(Step(kind="commit", path=str(trace.relative(self.file)), value=lasts))

    with mock.patch.object(Database, "writing", writing):
        yield
