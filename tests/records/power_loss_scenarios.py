"""What programs do with a store while `tests.records.power_loss` records it."""

from __future__ import annotations

import hashlib
import random
import shutil
import tempfile
import threading
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import timedelta
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest import mock

from tests.records.power_loss import Killed, RecordingDisk, Step, Trace, recorded_commits
from tests.records.sample import WHEN, levels, sample_calibration, sample_estimate

from tsis.calibration.file import calibration_bytes
from tsis.model.image import TactileImage
from tsis.records import database as engines
from tsis.records.audit import read_anchor
from tsis.records.blobs import frame_bytes
from tsis.records.store import Store, open_store

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

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
