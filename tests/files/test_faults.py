"""Faults under studies, sweeps, checks, exports and stores: disks that fail at any step, clocks that jump, odd paths.

The disk's steps are patched where every durable write passes. At each point the call says one sentence or passes, what
was acknowledged before is unchanged, no draft is left, and the same call passes once the disk is mended.
"""

from __future__ import annotations

import errno
import os
from contextlib import contextmanager, suppress
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any
from unittest import mock

import numpy as np
import pytest
from tests.records.sample import WHEN, levels, sample_record
from tests.study.made import made_study, table
from tests.sweep.stand_ins import quick, small_plan

from tsis.errors import RecordsError, TsisError
from tsis.files.atomic import UNFINISHED, Disk
from tsis.model.image import TactileImage
from tsis.records.export import write_csv
from tsis.records.store import open_store, verify_store
from tsis.records.target import read_bundle, write_bundle
from tsis.study.drift import CheckPlan, begin_checks, read_checks
from tsis.study.folder import enter_readings, open_study, verify_study
from tsis.study.plan import DeviceReading
from tsis.study.readings import import_readings
from tsis.sweep.data_set import begun, data_set_key, head, write_manifest
from tsis.sweep.shards import receipt_of, sweep_batches
from tsis.sweep.workers import Failed, Finished, SweepJob, finish_batch

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    Make = Callable[[Path], None]

STEPS = ("create", "write", "sync", "sync_again", "reopen", "rename", "name", "sync_folder", "make_folder")
SHORT = 500


@contextmanager
def failing(at: int, reason: int, *, lasting: bool = True) -> Iterator[dict[str, bool]]:
    """Within it the step of that number fails, and all after it if it is ``lasting``."""
    count, state = iter(range(10_000)), {"failed": False}

    def guarded(real: Callable[..., Any]) -> Callable[..., Any]:
        def step(self: Disk, *given: Any, **named: Any) -> Any:
            number = next(count)
            if number == at or (lasting and number > at):
                state["failed"] = True
                raise OSError(reason, os.strerror(reason))
            return real(self, *given, **named)

        return step

    patches: dict[str, Any] = {name: guarded(getattr(Disk, name)) for name in STEPS}
    with mock.patch.multiple(Disk, **patches):
        yield state


def drafts(folder: Path) -> list[str]:
    return [path.name for path in folder.rglob(f"*{UNFINISHED}*")]


def refused(call: Callable[[], object]) -> bool:
    """Whether a call raised one sentence; anything else that it raises fails the test."""
    try:
        call()
    except TsisError as error:
        said = str(error)
    else:
        return False
    assert "\n" not in said
    assert len(said) < SHORT
    return True


def made(folder: Path) -> None:
    made_study(folder / "study", present=2, blank=2)


def checks(folder: Path) -> None:
    begin_checks(folder / "checks", CheckPlan(probe="tsis-2011", phantom="size-8", force_n=1.0), actor="Ada")


def bundle(folder: Path) -> None:
    write_bundle(sample_record(), folder / "bundle.zip")


def spreadsheet(folder: Path) -> None:
    write_csv(sample_record(), folder / "csv")


MAKING: dict[Make, Callable[[Path], object]] = {
    made: lambda folder: verify_study(folder / "study"),
    checks: lambda folder: read_checks(folder / "checks"),
    bundle: lambda folder: read_bundle(folder / "bundle.zip"),
    spreadsheet: lambda folder: (folder / "csv" / "target.csv").read_bytes(),
}


@pytest.mark.parametrize(
    "reason",
    [
        errno.ENOSPC,
        *(pytest.param(number, marks=pytest.mark.slow) for number in (errno.EIO, errno.EROFS, errno.EDQUOT)),
    ],
    ids=lambda number: errno.errorcode[number],
)
@pytest.mark.parametrize("make", MAKING, ids=lambda make: make.__name__)
def test_what_cannot_be_made_is_one_sentence_and_is_made_later(tmp_path: Path, make: Make, reason: int) -> None:
    points = 0
    for at in range(60):
        place = tmp_path / str(at)
        place.mkdir()
        with failing(at, reason) as state:
            said = refused(lambda: make(place))  # noqa: B023 - used at once
        if not state["failed"]:
            break
        points += 1
        assert drafts(place) == []
        if said and not list(place.iterdir()):
            make(place)
        MAKING[make](place)  # whole, whether it was said to have failed at the last step or not
    assert points >= 3


@pytest.mark.parametrize("lasting", [True, False])
def test_readings_that_find_no_room_are_none_of_them_entered(tmp_path: Path, lasting: bool) -> None:
    study = made_study(tmp_path / "study", present=2, blank=2)
    (tmp_path / "readings.csv").write_text(table(study))
    for at in range(20):
        with failing(at, errno.ENOSPC, lasting=lasting) as state:
            said = refused(lambda: import_readings(study, tmp_path / "readings.csv", device="d", actor="Cleo"))
        entered = len(open_study(study.folder).readings)
        assert entered == (0 if said else 4)
        assert list(verify_study(study.folder).faults) == []
        if not said:
            break
    assert state["failed"] is False
    assert at >= 2


def test_a_sweep_finishes_its_files_after_any_failure(tmp_path: Path) -> None:
    plan = small_plan(count=10)
    start = head(plan)
    batch = next(sweep_batches(plan))
    folder = tmp_path / "sweep"
    folder.mkdir()
    with begun(folder, start):
        job = SweepJob(folder=str(folder), plan=plan, data_set=data_set_key(start), press=quick)
        for at in range(20):
            with failing(at, errno.ENOSPC) as state:
                outcome = finish_batch(job, batch)
            assert drafts(folder) == []
            if not state["failed"]:
                break
            assert isinstance(outcome, Failed)
            assert "\n" not in outcome.reason
        assert at >= 3
        assert isinstance(outcome, Finished)
        (shard,) = (path for path in folder.iterdir() if path.suffix == ".parquet")
        assert receipt_of(shard.read_bytes(), shard=0, data_set=job.data_set) == outcome.receipt
        before = {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}
        with failing(0, errno.EIO), suppress(OSError):
            write_manifest(folder, start, [outcome.receipt])
        assert {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()} == before


class Killed(BaseException):
    """The program ends here: nothing is caught, nothing is cleaned up."""


@pytest.mark.parametrize("make", MAKING, ids=lambda make: make.__name__)
def test_a_program_that_ends_at_any_step_leaves_nothing_half(tmp_path: Path, make: Make) -> None:
    points = 0
    for at in range(60):
        place, count = tmp_path / str(at), iter(range(10_000))
        place.mkdir()

        def step(self: Disk, *given: Any, real: Any, **named: Any) -> Any:
            if next(count) >= at:  # noqa: B023 - used at once
                raise Killed
            return real(self, *given, **named)

        def ending(name: str) -> Callable[..., Any]:
            real = getattr(Disk, name)
            return lambda self, *given, **named: step(self, *given, real=real, **named)

        patches: dict[str, Any] = {name: ending(name) for name in (*STEPS, "remove")}
        with mock.patch.multiple(Disk, **patches):
            try:
                make(place)
                ended = False
            except Killed:
                ended = True
        if not ended:
            break
        points += 1
        if not [path for path in place.iterdir() if UNFINISHED not in path.name]:
            make(place)
        MAKING[make](place)
    assert points >= 3


def test_a_clock_that_jumps_spoils_no_store(tmp_path: Path) -> None:
    now = datetime(2026, 5, 1, tzinfo=UTC)
    jumps = (timedelta(0), timedelta(days=400), timedelta(days=-4000), timedelta(hours=-1), timedelta(days=9000))
    with open_store(tmp_path / "store") as store:
        target = store.add_target(name="a")
        for number, jump in enumerate(jumps):
            with mock.patch("tsis.records.audit.datetime") as clock:
                clock.now.return_value = now + jump
                frame = TactileImage(grey=levels(number), full_scale=255.0, force_n=1.0)
                store.add_press(target, frame, taken=WHEN + jump)
        found = verify_store(store)
        assert found.sound
        assert found.head.number >= len(jumps)
        taken = [press.taken for press in store.presses(target)]
        assert sorted(taken) == sorted(WHEN + jump for jump in jumps)


def test_a_clock_that_jumps_spoils_no_study(tmp_path: Path) -> None:
    study = made_study(tmp_path / "study", present=2, blank=2)
    now = datetime(2026, 5, 1, tzinfo=UTC)
    for code, days in zip(study.plan.codes, (0, 500, -3000, -1), strict=True):
        reading = DeviceReading(device="thumb", operator="Ada", code=code, repeat=1, score=0.5)
        with mock.patch("tsis.study.log.datetime") as clock:
            clock.now.return_value = now + timedelta(days=days)
            study = enter_readings(study, [reading], actor="Ada")
    assert list(verify_study(study.folder).faults) == []
    assert len(open_study(study.folder).readings) == 4


ODD = {
    "too long": "n" * 300,
    "a very long path": "/".join(["n" * 200] * 25),
    "a null": "a\0b",
    "not UTF-8": os.fsdecode(b"caf\xe9"),
    "a line break": "a\nb",
    "a right-to-left mark": "a\u202eb",
    "spaces": "  a b  ",
}


@pytest.mark.parametrize("make", MAKING, ids=lambda make: make.__name__)
@pytest.mark.parametrize("name", ODD.values(), ids=ODD.keys())
def test_odd_paths_are_served_or_refused_in_a_sentence(tmp_path: Path, make: Make, name: str) -> None:
    place = tmp_path / name
    if not refused(lambda: make(place)):
        MAKING[make](place)


@pytest.mark.parametrize("name", ODD.values(), ids=ODD.keys())
def test_a_store_of_an_odd_path_works_or_is_refused_in_a_sentence(tmp_path: Path, name: str) -> None:
    def stored() -> None:
        with open_store(tmp_path / name) as store:
            frame = TactileImage(grey=np.ones((4, 5)), full_scale=255.0, force_n=1.0)
            store.add_press(store.add_target(), frame, taken=WHEN)
            assert verify_store(store).sound

    refused(stored)


@pytest.mark.parametrize("make", MAKING, ids=lambda make: make.__name__)
def test_a_loop_of_links_and_a_file_in_the_way_are_one_sentence(tmp_path: Path, make: Make) -> None:
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    (tmp_path / "file").write_bytes(b"here")
    for name in ("loop", "file"):
        assert refused(lambda: make(tmp_path / name))  # noqa: B023 - used at once
    assert (tmp_path / "file").read_bytes() == b"here"


def test_a_store_whose_files_cannot_be_read_says_which(tmp_path: Path) -> None:
    with open_store(tmp_path / "store") as store:
        target = store.add_target()
        frame = TactileImage(grey=levels(1), full_scale=255.0, force_n=1.0)
        press = store.add_press(target, frame, taken=WHEN)
        path = next((tmp_path / "store").rglob("*.png"))
        whole = path.read_bytes()
        for damaged in (b"", whole[:-1], whole[:50] + b"\0" + whole[51:], whole + b"more"):
            path.chmod(0o600)
            path.write_bytes(damaged)
            with pytest.raises(RecordsError) as said:
                store.levels(press.frame)
            assert path.name[:16] in str(said.value) or "stored" in str(said.value)
        path.write_bytes(whole)
        np.testing.assert_array_equal(store.levels(press.frame), levels(1))
