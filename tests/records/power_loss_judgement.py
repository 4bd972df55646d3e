"""Whether what was acknowledged is there in a state that a disk may hold after power was lost."""

from __future__ import annotations

import itertools
import json
import sqlite3
import tempfile
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from tests.records.power_loss_playback import Playback, sha256
from tests.records.power_loss_scenarios import PLACE, image
from tests.records.sample import WHEN

from tsis.errors import RecordsError
from tsis.records.audit import ANCHOR_FILE as ANCHOR
from tsis.records.database import DATABASE_FILE
from tsis.records.store import open_store, verify_store
from tsis.records.values import StoredEstimate, StoredPress, Target, estimate_to_json

if TYPE_CHECKING:
    import random
    from collections.abc import Collection, Iterator

    from tests.records.power_loss import Step
    from tests.records.power_loss_playback import State
    from tests.records.power_loss_scenarios import Kept, Run

    from tsis.records.store import Store


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
