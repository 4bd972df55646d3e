"""What a disk may hold after power was lost: every step by which files get onto it, recorded.

`tests.records.power_loss` makes states of them.

The promises are the weakest sensible ones. Of what was written to a file and not synced anything may be there: nothing,
a part, blocks of zeros, blocks of something else. Each name that was given, taken or changed in a folder and not synced
may be there or not, independently of all others; a name that was given to another file by renaming may also be lost.
What `Disk.sync` returned for lasts without its name, what `Disk.sync_folder` returned for are the names in that folder.
A commit lasts when it returned if the connection itself says that it syncs; otherwise any earlier one may come back."""

from __future__ import annotations

import hashlib
import itertools
import json
import random
import shutil
import sqlite3
import sys
import tempfile
import threading
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field
from datetime import timedelta
from functools import cache, lru_cache, partial
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any
from unittest import mock

from tests.records.sample import WHEN, levels, sample_calibration, sample_estimate

from tsis.calibration.file import calibration_bytes
from tsis.errors import RecordsError
from tsis.files.atomic import Disk
from tsis.model.image import TactileImage
from tsis.records import database as engines
from tsis.records.audit import ANCHOR_FILE as ANCHOR
from tsis.records.audit import read_anchor
from tsis.records.blobs import frame_bytes
from tsis.records.database import DATABASE_FILE, Database
from tsis.records.store import Store, open_store, verify_store
from tsis.records.values import StoredEstimate, StoredPress, Target, estimate_to_json

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator

    from tsis.records.store import Store


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


BLOCK = 512
FOLDER = -1  # what a name stands for besides files, which are numbered


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


PLACE = "home/records/phantoms"  # below the root of the recorded disk, of which only `home` is there before


@dataclass(frozen=True, slots=True, kw_only=True)
class Kept:
    """What was acknowledged: after which commit, in which files of the store, with which anchor."""

    commit: int
    files: tuple[str, ...]
    anchor: int
    record: Any


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """A name and what was recorded under it."""

    name: str
    trace: Trace


class Bench:
    """Programs that work on one store, on a disk that is recorded."""

    def __init__(self, trace: Trace) -> None:
        self.trace, self.place = trace, trace.root / PLACE
        self.disks: list[RecordingDisk] = []

    def open(self, **values: Any) -> Store:
        """As another program does."""
        self.disks.append(RecordingDisk(self.trace, **values))
        store = open_store(self.place, actor="bench", disk=self.disks[-1])
        self.keep(None)
        return store

    def keep(self, record: Any, *files: tuple[str, str]) -> Any:
        """Take note that a call returned."""
        anchor = read_anchor(self.place)[1].number
        paths = tuple(f"files/{name[:2]}/{name}.{ending}" for name, ending in files)
        kept = Kept(commit=len(self.trace.commits) - 1, files=paths, anchor=anchor, record=record)
        self.trace.steps.append(Step(kind="keep", value=kept))
        return record

    def target(self, store: Store) -> Any:
        return self.keep(store.add_target(name="a"))

    def press(self, store: Store, target: Any, seed: int, *, calibrated: bool = False) -> Any:
        known = sample_calibration() if calibrated else None
        kept = store.add_press(target, image(seed), taken=WHEN + timedelta(seconds=seed), calibration=known)
        files = [(kept.frame, "png")]
        if known is not None:
            files.append((store.blobs.put(calibration_bytes(known), "json"), "json"))
        return self.keep(kept, *files)

    def estimate(self, store: Store, target: Any, presses: Any) -> Any:
        made = store.add_estimate(
            target, sample_estimate(), kind="inclusion", presses=presses, probe="p", calibration=sample_calibration()
        )
        with store.database.reading() as connection:
            found = connection.exec_driver_sql("SELECT samples FROM estimates WHERE id = ?", (made.id,)).scalar_one()
        return self.keep(made, (found, "samples"))


def image(seed: int) -> TactileImage:
    """A small frame, of a few blocks."""
    return TactileImage(grey=levels(seed)[:40, :48], full_scale=255.0, mm_per_pixel=(0.1, 0.1), force_n=1.0)


def _new(bench: Bench) -> None:
    with bench.open() as store:
        target = bench.target(store)
        bench.press(store, target, 1)
        bench.press(store, target, 2)
    with bench.open() as store:
        bench.press(store, store.target(1), 3)


def _shared(bench: Bench) -> None:
    with bench.open() as store:
        target = bench.target(store)
        presses = [bench.press(store, target, seed) for seed in (1, 2, 1, 1)]
        bench.keep(store.edit_press(presses[2], note="again"))
        bench.keep(store.edit_target(target, name="b"))


def _estimated(bench: Bench) -> None:
    with bench.open() as store:
        target = bench.target(store)
        presses = [bench.press(store, target, seed, calibrated=True) for seed in (1, 2)]
        bench.estimate(store, target, presses)
        bench.estimate(store, target, presses)


def _copied_in(bench: Bench) -> None:
    """A frame put back by a program that syncs nothing, and then pressed again."""
    with bench.open() as store:
        target = bench.target(store)
        content = frame_bytes(image(5))
        name = hashlib.sha256(content).hexdigest()
        path = bench.place / "files" / name[:2] / f"{name}.png"
        if not path.parent.exists():
            path.parent.mkdir()
            bench.trace.steps.append(Step(kind="make_folder", path=str(bench.trace.relative(path.parent))))
        path.write_bytes(content)
        bench.disks[0].adopt(path)
        bench.press(store, target, 5)


def _killed(bench: Bench, at: int) -> int:
    """A program killed before one of its steps, and one that does the same again; how many the first took."""
    with suppress(Killed), bench.open(kill_at=at) as store:
        bench.press(store, bench.target(store), 1, calibrated=True)
    turns = bench.disks[0].turns
    with bench.open() as store:
        target = bench.target(store)
        bench.press(store, target, 1, calibrated=True)
        bench.press(store, target, 2)
    return turns


def _together(bench: Bench, seed: int) -> None:
    """Two programs in turns, changing at random steps; they begin the store together, and share frames."""
    baton = _Baton(random.Random(seed))

    def work(mine: int) -> None:
        with baton.held(mine), bench.open(before=lambda: baton.pass_on(mine)) as store:
            baton.pass_on(mine)
            target = bench.target(store)
            for each in (1, 2 + mine):
                bench.press(store, target, each)

    bench.open().close()
    threads = [threading.Thread(target=work, args=(mine,)) for mine in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not baton.failed, baton.failed


class _Baton:
    """Lets one thread run at a time, so that a run is the same every time."""

    def __init__(self, rng: random.Random) -> None:
        self._rng, self._change, self._turn = rng, threading.Condition(), 0
        self._running = {0, 1}
        self.failed: list[BaseException] = []

    @contextmanager
    def held(self, mine: int) -> Iterator[None]:
        with self._change:
            self._change.wait_for(lambda: self._turn == mine)
        try:
            yield
        except BaseException as error:
            self.failed.append(error)
        finally:
            with self._change:
                self._running.discard(mine)
                self._turn = 1 - mine
                self._change.notify_all()

    def pass_on(self, mine: int) -> None:
        if self._rng.random() < 0.5 and 1 - mine in self._running:
            with self._change:
                self._turn = 1 - mine
                self._change.notify_all()
                self._change.wait_for(lambda: self._turn == mine)


def runs(*, seed: int, kills: int | None, mixtures: int, pragma: str = "") -> Iterator[Run]:
    """Every scenario; ``kills`` of the steps before which the first program may be killed, all by default."""
    for name, work in (("new", _new), ("shared", _shared), ("estimated", _estimated), ("copied in", _copied_in)):
        yield _recorded(name, work, pragma=pragma)
    whole = Bench(Trace(root=Path()))
    _recorded("", lambda bench: whole.__dict__.update(turns=_killed(bench, -1)))
    points = list(range(whole.__dict__["turns"]))
    for at in points if kills is None else sorted(random.Random(seed).sample(points, kills)):
        yield _recorded(f"killed before step {at}", partial(_killed, at=at), pragma=pragma)
    for mixture in range(mixtures):
        yield _recorded(f"two writers {mixture}", partial(_together, seed=seed + mixture), pragma=pragma)


def _recorded(name: str, work: Callable[[Bench], Any], *, pragma: str = "") -> Run:
    root = Path(tempfile.mkdtemp(prefix="tsis-power-"))
    trace = Trace(root=root)
    (root / "home").mkdir()
    trace.steps += [Step(kind="make_folder", path="home"), Step(kind="sync_folder", path=".")]
    try:
        with recorded_commits(trace), weakened(pragma):
            work(Bench(trace))
    finally:
        shutil.rmtree(root)
    return Run(name=name, trace=trace)


@contextmanager
def weakened(pragma: str) -> Iterator[None]:
    """Connections to SQLite that all get a pragma after those of the store."""
    with mock.patch.object(engines, "_PRAGMAS", (*engines._PRAGMAS, pragma) if pragma else engines._PRAGMAS):
        yield


class Judge:
    """Goes along a trace and knows what was acknowledged so far."""

    def __init__(self, run: Run) -> None:
        self._run = run
        self.kept: list[Kept] = []
        self._files: set[str] = set()
        self._commit = 0
        self._anchor, self._under_way = -1, True
        self._written: dict[int, bytes] = {}
        self._chains = [_chain(each) for each in run.trace.commits]

    def step(self, step: Step) -> None:
        """Take note of one more step."""
        if step.kind == "write":
            self._written[step.file] = self._written.get(step.file, b"") + step.content
        elif step.kind == "rename" and step.to == f"{PLACE}/{ANCHOR}":
            self._anchor = min(self._anchor, json.loads(self._written[step.file])["number"])
            self._under_way = True
        elif step.kind == "keep":
            self.kept.append(step.value)
            self._files.update(step.value.files)
            self._commit = max(self._commit, step.value.commit)
            self._anchor, self._under_way = step.value.anchor, False

    def losses(self, state: State) -> list[str]:
        """What is missing, damaged or wrong; nothing when all that was acknowledged is there."""
        found = []
        if self.kept and state.commit < self._commit:
            found.append("row")
        for path in self._files:
            content = state.files.get(f"{PLACE}/{path}")
            if content is None or sha256(content) != path[9:73]:  # files/ab/abcd….png
                found.append("file")
        return found + self._anchor_losses(state)

    def _anchor_losses(self, state: State) -> list[str]:
        content = state.files.get(f"{PLACE}/{ANCHOR}")
        if content is None:
            return [] if self._under_way or not self.kept else ["anchor"]
        try:
            document = json.loads(content)
            number, result = document["number"], document["hash"]
        except (ValueError, KeyError, TypeError):
            return ["torn anchor"]
        if number and self._chains[state.commit].get(number) != result:
            return ["anchor ahead"]
        return ["old anchor"] if number < self._anchor else []


def points(run: Run, *, skipped: Collection[int] = (), since: int = 0) -> Iterator[tuple[Playback, Judge]]:
    """The disk and the judge at every point of a run from a step on."""
    disk, judge = Playback(run.trace, skipped=skipped, database=PLACE), Judge(run)
    for number, step in enumerate(run.trace.steps):
        disk.step()
        judge.step(step)
        if number >= since:
            yield disk, judge


def explored(disk: Playback, rng: random.Random, seen: set[bytes], salt: bytes, most: int) -> Iterator[State]:
    """States that were not seen before: the systematic ones, and at random until there are few new ones or so many."""
    old = 0
    for state in itertools.chain(disk.systematic(), iter(lambda: disk.drawn(rng), None)):
        key = salt + state.key()
        if key not in seen:
            old = 0
            most -= 1
            seen.add(key)
            yield state
        else:
            old += 1
        if old > 150 or most <= 0:
            return


def without(run: Run, number: int) -> tuple[int, int]:
    """States after a sync that did nothing, up to the first point at which some lose something, and how many do."""
    states = bad = 0
    for disk, judge in points(run, skipped={number}, since=number):
        for state in disk.systematic():
            states += 1
            bad += bool(judge.losses(state))
        if bad:
            break
    return states, bad


def label(step: Step) -> str:
    """Which sync of the program it was."""
    if step.site.startswith("open_store"):
        return step.site + (" of the store" if step.path == PLACE else " above it")
    return step.site


def _chain(database: bytes) -> dict[int, str]:
    if not database:
        return {}
    with closing(sqlite3.connect(":memory:")) as connection:
        connection.deserialize(b"".join((database[:18], b"\1\1", database[20:])))  # in memory is no write-ahead log
        return dict(connection.execute("SELECT number, hash FROM audit"))


def reopened(state: State, run: Run, kept: list[Kept]) -> list[str]:
    """Put a state on a real disk, open it, read all that was acknowledged, verify it, and store one more.

    Returns
    -------
    list of str
        What went wrong.
    """
    with tempfile.TemporaryDirectory(prefix="tsis-power-") as folder:
        root = Path(folder)
        for each in sorted(state.folders):
            (root / each).mkdir(mode=0o700)
        for path, content in state.files.items():
            (root / path).write_bytes(content)
        if state.commit > 0:
            (root / PLACE / DATABASE_FILE).write_bytes(run.trace.commits[state.commit])
        try:
            with open_store(root / PLACE, create=not kept, actor="after") as store:
                found = _missing(store, kept) if kept else []
                found += _faults(store, state)
                store.add_press(store.add_target(), image(1), taken=WHEN)
                return found + list(verify_store(store).faults)
        except RecordsError as error:
            return [str(error)]


def _faults(store: Store, state: State) -> list[str]:
    faults = verify_store(store).faults
    if f"{PLACE}/{ANCHOR}" not in state.files:  # judged apart: it may be lost on its way
        return [fault for fault in faults if "anchor" not in fault]
    return list(faults)


def _missing(store: Store, kept: list[Kept]) -> list[str]:
    found = []
    targets = {each.target.id: each.target for each in store.targets()}
    presses = {each.id: each for target in targets.values() for each in store.presses(target)}
    estimates = {each.id: each for target in targets.values() for each in store.estimates(target)}
    for record in (each.record for each in kept):
        if isinstance(record, Target):
            here: Target | StoredPress | None = targets.get(record.id)
            if here is None or (here.version <= record.version and here != record):
                found.append(f"target {record.number}")
        elif isinstance(record, StoredPress):
            here = presses.get(record.id)
            if here is None or (here.version <= record.version and here != record):
                found.append(f"press {record.id}")
            elif store.levels(record.frame).shape != (record.rows, record.columns):
                found.append(f"frame of {record.id}")
            if record.calibration is not None:
                store.calibration(record.calibration)
        elif isinstance(record, StoredEstimate):
            estimate = estimates.get(record.id)
            if estimate is None or estimate_to_json(estimate) != estimate_to_json(record):
                found.append(f"estimate {record.id}")
    return found
