"""Power lost at any point takes away nothing that was acknowledged; of the syncs that hold this none can be spared."""

from __future__ import annotations

import random
from itertools import islice
from typing import TYPE_CHECKING

import pytest
from tests.endurance import scaled
from tests.records.power_loss import (
    PLACE,
    SYNCS,
    Playback,
    Run,
    Trace,
    damaged,
    explored,
    label,
    points,
    reopened,
    runs,
    without,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

FIRST = 5  # scenarios that between them take every sync


class Recorded:
    """Runs, recorded when first asked for."""

    def __init__(self) -> None:
        self._known: list[Run] = []
        self._more = runs(seed=1, kills=None, mixtures=2)

    def __iter__(self) -> Iterator[Run]:
        yield from self._known
        for run in self._more:
            self._known.append(run)
            yield run


@pytest.fixture(scope="module")
def recorded() -> Recorded:
    return Recorded()


def test_nothing_acknowledged_is_lost_in_any_state(recorded: Recorded) -> None:
    rng, kept = random.Random(1), 0
    seen: set[bytes] = set()
    for run in islice(recorded, FIRST):
        for disk, judge in points(run):
            kept = max(kept, len(judge.kept))
            for state in explored(disk, rng, seen, run.name.encode(), 100):
                assert judge.losses(state) == [], (run.name, disk.taken)
    assert len(seen) > 3000
    assert kept == 8


def test_a_state_on_a_real_disk_is_opened_read_verified_and_added_to(recorded: Recorded) -> None:
    rng, opened = random.Random(2), 0
    for run in islice(recorded, FIRST):
        for disk, judge in points(run):
            if rng.random() < 0.03:
                assert reopened(disk.drawn(rng), run, judge.kept) == [], (run.name, disk.taken)
                opened += 1
    assert opened > 8


def test_opening_sees_what_the_judge_sees(recorded: Recorded) -> None:
    """The two ways of judging agree on a state in which the last frame is gone."""
    (run,) = islice(recorded, 1)
    (*_, (disk, judge)) = points(run)
    whole = next(disk.systematic())
    frame = judge.kept[-1].files[0]
    del whole.files[f"{PLACE}/{frame}"]
    assert judge.losses(whole) == ["file"]
    assert any("stored file must be there" in each for each in reopened(whole, run, judge.kept))


def test_every_sync_left_out_is_missed(recorded: Recorded) -> None:
    expected = {
        label(step) for run in islice(recorded, FIRST) for step in run.trace.steps if step.kind in SYNCS and step.site
    }
    assert len(expected) >= 8
    for run in recorded:
        for number, step in enumerate(run.trace.steps):
            if step.kind in SYNCS and label(step) in expected and without(run, number)[1]:
                expected.discard(label(step))
        if not expected:
            break
    assert not expected, "nothing is lost where these are left out: they are needless, or the model is too kind"


@pytest.mark.parametrize("pragma", ["synchronous=NORMAL", "synchronous=OFF"])
def test_a_database_that_syncs_less_loses_rows(pragma: str) -> None:
    (run,) = islice(runs(seed=1, kills=0, mixtures=0, pragma=pragma), 1)
    assert any("row" in judge.losses(state) for disk, judge in points(run) for state in disk.systematic())


@pytest.mark.slow
def test_nothing_is_lost_wherever_a_program_was_killed_before(recorded: Recorded) -> None:
    killed = 0
    for run in recorded:
        killed += "killed" in run.name
        for disk, judge in points(run):
            for state in disk.systematic():
                assert judge.losses(state) == [], (run.name, disk.taken)
    assert killed > 30


@pytest.mark.slow
def test_nothing_acknowledged_is_lost_in_many_drawn_states() -> None:
    rng, seen = random.Random(2), set[bytes]()
    for number, run in enumerate(runs(seed=2, kills=None, mixtures=12)):
        for disk, judge in points(run):
            for state in explored(disk, rng, seen, f"{number}".encode(), scaled(20)):
                assert judge.losses(state) == [], (run.name, disk.taken)
    assert len(seen) > 3000


def test_damage_is_what_it_says() -> None:
    content = bytes(range(1, 251)) * 8
    assert damaged(content, 0, 1) == b""
    assert damaged(content, 1, 1) == content[:1000]
    assert damaged(content, 2, 1) == bytes(2000)
    found = {damaged(content, each, 1) for each in range(3, 60)}
    assert len(found) > 30
    assert all(len(each) <= 2000 for each in found)


def test_a_disk_that_was_told_nothing_is_empty(tmp_path_factory: pytest.TempPathFactory) -> None:
    disk = Playback(Trace(root=tmp_path_factory.getbasetemp()), database=PLACE)
    assert {(len(state.files), state.commit) for state in disk.systematic()} == {(0, -1)}
