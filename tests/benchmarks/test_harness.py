"""The table of hot paths says what was measured, and does not hide who is faster."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from benchmarks.harness import Bench, Choice, Contest, Goal, Place, Several, Side, in_turns, missing, timed, version
from benchmarks.speed import PATHS, cells, measured

if TYPE_CHECKING:
    from collections.abc import Callable


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


def test_a_run_prints_its_tables_and_goals_and_writes_them_with_the_machine(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.argv", ["bench", "--cases", "3", "--only", "b", "--out", str(tmp_path)])
    bench = Bench("About", cases=12, only=Several("ab"), world=Choice("xy", "x"), far=False, frames=Path)
    assert (bench.cases, bench.only, bench.world, bench.far, bench.frames) == (3, ["b"], "x", False, None)
    bench.table("First table", ("a", "b"), [(1, "two")])
    rate = Goal(name="rate", value=30.0, least=30.0)
    assert bench.end([rate, Goal(name="age", value=61.0, most=60.0, form="{:.0f} ms")]) == 1
    printed = capsys.readouterr().out
    assert "missed: age is 61 ms, its goal <= 60 ms" in printed
    assert (tmp_path / "first-table.csv").read_text() == "a,b\n1,two\n"
    assert (tmp_path / "goals.csv").read_text().splitlines()[1:] == [
        "rate,>= 30.0,30.0,,met",
        "age,<= 60 ms,61 ms,,missed",
    ]
    result = json.loads((tmp_path / "result.json").read_text())
    assert result["machine"]["versions"]["numpy"] == np.__version__
    assert [goal["met"] for goal in result["goals"]] == [True, False]


@pytest.mark.parametrize(
    ("value", "least", "most", "goal"), [(math.nan, 1.0, math.inf, ">= 1.0"), (4.0, 1.0, 3.0, ">= 1.0 and <= 3.0")]
)
def test_what_lies_elsewhere_or_is_no_number_is_missed(value: float, least: float, most: float, goal: str) -> None:
    one = Goal(name="rate", value=value, least=least, most=most)
    assert not one.met
    assert one.goal == goal


def test_what_is_not_installed_is_named() -> None:
    assert version("no-such-package") is None
    assert missing("no_such_package") == "no_such_package is not installed"
    assert missing("numpy") == ""


def test_a_path_s_rows_are_of_this_run(tmp_path: Path) -> None:
    place = Place(folder=tmp_path, peer_python="python")
    rows = list(measured({"reading": PATHS["reading"]}, place, turns=1, progress=lambda *_: None))
    assert [row.peer.split()[0] for row in rows] == ["OpenCV", "Pillow"] * 2
    for row in rows:
        assert row.ratio == row.peer_s[0] / row.own_s[0]
