"""Programs that are killed, or write at once, lose nothing that was acknowledged, and harm nobody else's."""

from __future__ import annotations

import json
import os
import random
import select
import signal
import subprocess
import sys
import time
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from datetime import timedelta
from subprocess import PIPE
from typing import IO, TYPE_CHECKING, Any

import pytest
from tests.endurance import scaled
from tests.records.sample import WHEN, levels, sample_calibration, sample_estimate

from tsis.errors import RecordsError, TsisError
from tsis.files.atomic import DISK, UNFINISHED, Disk
from tsis.model.image import TactileImage
from tsis.records.audit import has_entry, read_anchor
from tsis.records.store import open_store, verify_store

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from tests.records.conftest import Place

    from tsis.records.store import Store


pytestmark = [
    pytest.mark.system,
    pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork"),
    # In the child only this thread lives on; it takes no lock that another may have held.
    pytest.mark.filterwarnings("ignore:This process:DeprecationWarning"),
]


FRAMES = 60  # different ones, so that many presses share them
LONGEST_S = 0.15  # of a life, counted from the fork or from the first acknowledgement


@dataclass
class Found:
    """What was found after so many cycles, each the life of one program."""

    cycles: int = 0
    acknowledged: int = 0
    lost: list[str] = field(default_factory=list)  # acknowledged, and not there or not whole
    torn: list[str] = field(default_factory=list)  # files whose content is not what their name says, anchors too
    faults: list[str] = field(default_factory=list)  # of `verify_store`, or stores that could not be opened
    lagging: int = 0  # how often the anchor was behind
    unnamed: int = 0  # files that no row names, at the end


class Careless(Disk):
    """Writes under the final name at once, and syncs nothing: what this harness must be able to see."""

    def create(self, path: Path, *, private: bool = False) -> IO[bytes]:
        name = path.name.removeprefix(".").removesuffix(UNFINISHED).rpartition("-")[0]
        folder = path.parent / name[:2] if path.parent.name == "files" else path.parent
        return (folder / name).open("wb")

    def write(self, file: IO[bytes], content: bytes) -> None:
        for i in range(0, len(content), 16):
            super().write(file, content[i : i + 16])

    def sync(self, file: IO[bytes]) -> None: ...

    def sync_folder(self, folder: Path) -> None: ...

    def rename(self, draft: Path, path: Path) -> None: ...

    def name(self, draft: Path, path: Path) -> None: ...

    def remove(self, path: Path) -> None: ...


def killed_cycles(folder: Path, cycles: int, *, seed: int, writers: int = 2, every: int = 500, disk: Disk) -> Found:
    """Let so many programs be killed, some at a time, and look after them; all is verified after ``every`` so many."""
    rng, found = random.Random(seed), Found()
    for cycle in range(writers, cycles + 1, writers):
        result = _killed([_started(folder, rng.getrandbits(32), disk) for _ in range(writers)], rng)
        found.faults += [each["said"] for each in result if each["kind"] == "failed"]
        result = [each for each in result if each["kind"] != "failed"]
        found.cycles, found.acknowledged = cycle, found.acknowledged + len(result)
        try:
            with open_store(folder, actor="after") as store:
                _look(store, result, found)
                if cycle % every == 0 or cycle + writers > cycles:
                    _look_at_all(store, found)
        except TsisError as error:
            found.faults.append(str(error))
            if "anchor" in str(error):  # it would stay so, and hide all else
                found.torn.append("anchor")
                (folder / "audit-anchor.json").unlink(missing_ok=True)
    return found


def _started(folder: Path, seed: int, disk: Disk) -> tuple[int, int]:
    """A program's number, and where it tells what was acknowledged."""
    read, write = os.pipe()
    number = os.fork()
    if number == 0:
        os.close(read)
        try:
            _work(folder, write, random.Random(seed), disk)
        except BaseException as error:
            _tell(write, kind="failed", said=f"{type(error).__name__}: {error}")
        os._exit(1)
    os.close(write)
    return number, read


def _work(folder: Path, pipe: int, rng: random.Random, disk: Disk) -> None:
    known, made = sample_calibration(), sample_estimate()
    with open_store(folder, actor="writer", disk=disk) as store:
        while True:
            target = store.add_target(name="a")
            presses = []
            for _ in range(4):
                seed = rng.randrange(FRAMES)
                calibration = known if rng.random() < 0.5 else None
                image = TactileImage(grey=levels(seed), full_scale=255.0, force_n=1.0)
                press = store.add_press(target, image, taken=WHEN + timedelta(seconds=seed), calibration=calibration)
                _tell(pipe, kind="press", id=press.id, frame=press.frame, version=press.version)
                presses.append(press)
            edited = store.edit_press(presses[0], note=f"edited {rng.random()}")
            _tell(pipe, kind="press", id=edited.id, frame=edited.frame, version=edited.version, note=edited.note)
            estimate = store.add_estimate(
                target, made, kind="inclusion", presses=presses, probe="tsis-2011", calibration=known
            )
            _tell(pipe, kind="estimate", id=estimate.id)


def _tell(pipe: int, **what: Any) -> None:
    os.write(pipe, json.dumps(what).encode() + b"\n")


def _killed(programs: list[tuple[int, int]], rng: random.Random) -> list[dict[str, Any]]:
    """Kill them all at random moments; what they had acknowledged by then."""
    result = []
    for number, pipe in programs:
        if rng.random() < 0.7:  # else perhaps while it is still opening
            select.select([pipe], [], [], 10.0)
        time.sleep(rng.uniform(0, LONGEST_S / len(programs)))
        os.kill(number, signal.SIGKILL)
        os.waitpid(number, 0)
        with os.fdopen(pipe, "rb") as lines:
            result += [json.loads(line) for line in lines]
    return result


def _look(store: Store, told: list[dict[str, Any]], found: Found) -> None:
    with store.database.reading() as connection:
        query = "SELECT frame, version, note FROM presses WHERE id = ?"
        for each in told:
            if each["kind"] == "estimate":
                row = connection.exec_driver_sql("SELECT samples FROM estimates WHERE id = ?", (each["id"],)).first()
                file = None if row is None else (row.samples, "samples")
            else:
                row = connection.exec_driver_sql(query, (each["id"],)).first()
                file = None if row is None else (row.frame, "png")
                if row is not None and row.version == each["version"] and row.note != each.get("note", ""):
                    found.lost.append(f"edit of {each['id']}")
            if row is None or file is None:
                found.lost.append(f"{each['kind']} {each['id']}")
                continue
            try:
                store.blobs.get(*file)
            except RecordsError as error:
                found.lost.append(str(error))
        _, anchored = read_anchor(store.folder)
        if anchored.number and not has_entry(connection, anchored):
            found.faults.append("the anchor is ahead")
        found.lagging += connection.exec_driver_sql("SELECT number FROM audit_head").scalar_one() > anchored.number


def _look_at_all(store: Store, found: Found) -> None:
    verified = verify_store(store)
    found.faults += verified.faults
    found.unnamed = verified.unnamed
    for name, ending in store.blobs.names():
        try:
            store.blobs.get(name, ending)
        except RecordsError:
            found.torn.append(f"{name}.{ending}")


def test_nothing_acknowledged_is_lost(tmp_path: Path) -> None:
    found = killed_cycles(tmp_path, 100, seed=200, every=20, disk=DISK)
    assert (found.lost, found.torn, found.faults) == ([], [], [])
    assert found.acknowledged > 100


@pytest.mark.slow
def test_nothing_acknowledged_is_lost_in_many_lives(tmp_path: Path) -> None:
    found = killed_cycles(tmp_path, scaled(300), seed=1, every=100, disk=DISK)
    assert (found.lost, found.torn, found.faults) == ([], [], [])


@pytest.mark.slow
def test_a_store_that_writes_carelessly_is_found_out(tmp_path: Path) -> None:
    found = killed_cycles(tmp_path, 150, seed=3, every=10, disk=Careless())
    assert found.torn


@contextmanager
def writers(place: Place, count: int, presses: int) -> Iterator[list[subprocess.Popen[str]]]:
    """So many programs at once; none is left when the block ends."""
    command = [sys.executable, "-m", "tests.records.writer", str(place.folder), place.database or "-"]
    with ExitStack() as running:
        started = []
        for seed in range(count):
            one = subprocess.Popen([*command, str(seed), str(presses)], stdout=PIPE, stderr=PIPE, text=True)
            started.append(running.enter_context(one))
            running.callback(one.kill)
        yield started


def test_four_programs_that_create_and_fill_a_store_at_once(place: Place) -> None:
    said = []
    with writers(place, 4, 50) as running:
        for writer in running:
            out, err = writer.communicate()
            assert err == ""
            said += [line.split(" ", 1) for line in out.splitlines()]
    assert [rest for what, rest in said if what == "refused"] == []
    assert sorted(rest for what, rest in said if what == "number") == ["1", "2", "3", "4"]
    acknowledged = {rest for what, rest in said if what == "press"}
    assert len(acknowledged) == 200
    with place.open(create=False) as store:
        targets = [each.target for each in store.targets()]
        assert {press.id for target in targets for press in store.presses(target)} == acknowledged
        found = verify_store(store)
    assert found.sound
    assert found.unnamed == 0


def test_programs_killed_while_they_save_lose_nothing_that_was_acknowledged(place: Place) -> None:
    place.open().close()
    acknowledged = set()
    with writers(place, 3, 100_000) as running:
        for writer in running:
            assert writer.stdout is not None
            lines = [writer.stdout.readline() for _ in range(20)]
            writer.kill()
            lines += writer.stdout.read().splitlines(keepends=True)
            whole = [line.split() for line in lines if line.endswith("\n")]  # the last may be cut short
            acknowledged |= {rest for what, rest in whole if what == "press"}
    assert len(acknowledged) >= 57
    with place.open(create=False) as store:
        targets = [each.target for each in store.targets()]
        stored = {press.id for target in targets for press in store.presses(target)}
        assert acknowledged <= stored
        assert len(stored - acknowledged) <= 3  # each may have been killed before it could say so
        assert verify_store(store).sound
        store.add_target()
        assert verify_store(store).sound
