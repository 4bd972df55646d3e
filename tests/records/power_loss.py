"""What a disk may hold after power was lost: every step by which files get onto it, recorded.

`tests.records.power_loss_playback` makes states of them.

The promises are the weakest sensible ones. Of what was written to a file and not synced anything may be there: nothing,
a part, blocks of zeros, blocks of something else. Each name that was given, taken or changed in a folder and not synced
may be there or not, independently of all others; a name that was given to another file by renaming may also be lost.
What `Disk.sync` returned for lasts without its name, what `Disk.sync_folder` returned for are the names in that folder.
A commit lasts when it returned if the connection itself says that it syncs; otherwise any earlier one may come back.
"""

from __future__ import annotations

import itertools
import sqlite3
import sys
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any
from unittest import mock

from tsis.files.atomic import Disk
from tsis.records.database import Database

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

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

    def create(self, path: Path, *, private: bool = False) -> IO[bytes]:
        self._turn()
        opened = super().create(path, private=private)
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

    def make_folder(self, folder: Path, *, private: bool = False) -> None:
        self._turn()
        new = not folder.exists()
        super().make_folder(folder, private=private)
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
            if not frame.f_globals["__name__"].endswith(".atomic"):
                break
        frame = frame.f_back  # type: ignore[assignment]
    return " > ".join([*(name for name in reversed(names) if not name.startswith("Disk.")), kind])


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
