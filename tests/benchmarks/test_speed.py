"""The table of hot paths says what was measured, and does not hide who is faster."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from typing import TYPE_CHECKING

import numpy as np
import pytest
from benchmarks.hot.place import Place, missing, version
from benchmarks.machine import Machine
from benchmarks.peers.chebyshev_rings import rings_by_numpy
from benchmarks.peers.placement_matrix import area_and_variance
from benchmarks.speed import PATHS, cells, document, measured
from benchmarks.turns import Contest, Side, in_turns, timed

from tsis.mechanics.surrogate import Box, TissueSurrogate
from tsis.study.roc import auc_covariance

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path


class Clock:
    """A time that only work makes go by."""

    def __init__(self) -> None:
        self.now, self.done = 0.0, list[str]()

    def __call__(self) -> float:
        return self.now

    def work(self, name: str, seconds: float) -> Callable[[], None]:
        def call() -> None:
            self.done.append(name)
            self.now += seconds

        return call


def _told(times: list[float], heard: list[str], name: str) -> Callable[[], float]:
    left = iter(times)

    def seconds() -> float:
        heard.append(name)
        return next(left)

    return seconds


def test_programs_take_turns_and_a_ratio_is_of_one_turn() -> None:
    heard: list[str] = []
    contest = Contest(
        task="a task",
        own=Side(program="tsis", seconds=_told([1.0, 2.0, 4.0], heard, "tsis"), note="21 modes"),
        peers=(
            Side(program="quick", seconds=_told([0.5, 0.2, 3.0], heard, "quick")),
            Side(program="slow", seconds=_told([300.0, 400.0, 1000.0], heard, "slow"), note="the other 20"),
        ),
        absent=(("away", "away is not installed"),),
    )
    quick, slow, away = in_turns(contest, 3)
    assert heard == ["tsis", "quick", "slow", "slow", "quick", "tsis", "tsis", "quick", "slow"]
    assert quick.ratios == (0.5, 0.1, 0.75)
    assert cells(quick) == (
        "a task",
        "2 s",
        "quick",
        "500 ms",
        "0.5 (0.1 to 0.75), **the peer is faster**",
        "21 modes",
    )
    assert cells(slow)[3:] == ("400 s", "250 (200 to 300)", "21 modes, the other 20")
    assert cells(away) == ("a task", "2 s", "away", "-", "-", "away is not installed")


def test_a_clock_counts_calls_after_the_first_and_repeats_short_ones() -> None:
    clock = Clock()
    seconds = timed(clock.work("short", 0.004), clock=clock)
    assert seconds() == pytest.approx(0.004)
    assert clock.done == ["short"] * (1 + 1 + 5)  # one that warms up, one that tells how many, five that last 20 ms
    assert seconds() == pytest.approx(0.004)
    assert len(clock.done) == 12
    once = timed(clock.work("long", 3.0), once=True, clock=clock)
    assert once() == pytest.approx(3.0)
    assert clock.done.count("long") == 1


def test_a_document_holds_every_turn_and_says_where(tmp_path: Path) -> None:
    def path(_place: Place) -> Iterator[Contest]:
        for task in ("first", "second"):
            yield Contest(
                task=task,
                own=Side(program="tsis", seconds=lambda: 2.0),
                peers=(Side(program="other", seconds=lambda: 1.0),),
            )

    heard: list[tuple[int, str]] = []
    place = Place(folder=tmp_path, peer_python="python")
    rows = list(
        measured({"one": path, "two": path}, place, turns=2, progress=lambda done, what: heard.append((done, what)))
    )
    assert heard == [(0, "one"), (0, "first"), (0, "second"), (1, "two"), (1, "first"), (1, "second")]
    machine = Machine(
        processor="P",
        cores=2,
        load=(0.5, 1.5),
        versions={"numpy": "2", "gone": None},
        date=datetime(2026, 1, 2, tzinfo=UTC),
    )
    result = json.loads(json.dumps(document(rows, machine)))
    assert result["rows"][3] == {
        "task": "second",
        "tsis_s": [2.0, 2.0],
        "peer": "other",
        "peer_s": [1.0, 1.0],
        "ratio": 0.5,
        "note": "",
    }
    assert result["machine"]["load"] == [0.5, 1.5]
    assert machine.sentence() == (
        "P, 2 cores, load 0.5 before and 1.5 after, 02 January 2026. numpy 2. Not installed: gone."
    )


def test_this_machine_is_named() -> None:
    here = Machine.here({"numpy": version("numpy"), "nowhere": version("no-such-package")})
    assert here.processor
    assert here.versions["numpy"] == np.__version__
    assert here.versions["nowhere"] is None
    assert missing("no_such_package") == "no_such_package is not installed"
    assert missing("numpy") == ""


def test_peers_that_are_written_here_answer_as_tsis_does() -> None:
    rng = np.random.default_rng(3)
    present = rng.random(300) < 0.4
    scores = rng.normal(present, 1.0).round(1)
    found = auc_covariance([scores], present)
    assert area_and_variance(scores, present) == pytest.approx((found.auc[0], found.covariance[0, 0]), rel=1e-12)
    rings = TissueSurrogate(
        box=Box(), tissue_young_kpa=5.0, baseline=rng.normal(size=4), change=rng.normal(size=(5, 4, 3, 4))
    )
    asked = [rng.uniform(*interval, 2500) for interval in ((1.0, 15.0), (4.0, 12.0), (40.0, 120.0))]
    assert rings_by_numpy(rings)(*asked) == pytest.approx(rings(*asked), rel=1e-9, abs=1e-12)


def test_the_area_s_row_is_of_this_run(tmp_path: Path) -> None:
    place = Place(folder=tmp_path, peer_python="python")
    rows = list(measured({"area": PATHS["area"]}, place, turns=1, progress=lambda *_: None))
    assert len(rows) == 2
    for row in rows:
        assert row.ratio == row.peer_s[0] / row.own_s[0]
        assert "scikit-learn" in row.peer
