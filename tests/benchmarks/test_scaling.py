"""How exponents, curves and the plan past one machine follow from what was measured."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from benchmarks.cluster_plan import ClusterPlan, Overheads, PressCost, planned
from benchmarks.curves.curve import Curve, Line
from benchmarks.curves.figure import draw
from benchmarks.curves.surrogate import VARIED, boxed
from benchmarks.curves.workers import efficiency, sweep_plan
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from tsis.mechanics.surrogate.polynomial import Box

if TYPE_CHECKING:
    from pathlib import Path

COST = PressCost(model="flat", seconds=0.02, memory_mb=250.0, file_bytes=450.0)
BESIDE = Overheads(
    press_s=1e-4,
    shard_s=5e-3,
    start_s=2.0,
    task_rate=300.0,
    scheduler_s=1e-3,
    client_s=2e-3,
    task_bytes=7000.0,
    write_mb_s=10.0,
)


@given(st.floats(-3, 3), st.floats(1e-3, 1e3))
def test_an_exponent_is_that_of_the_power_it_was_made_by(power: float, factor: float) -> None:
    size = (10.0, 30.0, 200.0, 900.0)
    line = Line(name="n", unit="s", size=size, value=tuple(factor * each**power for each in size))
    assert line.exponent == pytest.approx(power, abs=1e-9)
    bent = replace(line, value=(1e6, *line.value[1:]), fit_from=30.0)
    assert bent.exponent == pytest.approx(power, abs=1e-9)


@given(st.integers(1, 2000), st.integers(1, 1000), st.floats(1e-4, 100.0), st.integers(1000, 2_000_000))
def test_a_plan_is_never_faster_than_its_cores_nor_its_scheduler(
    workers: int, batch: int, press_s: float, presses: int
) -> None:
    row = planned(replace(COST, seconds=press_s), BESIDE, workers, presses=presses, batch=batch)
    seconds, shards = 3600 * row.hours, math.ceil(presses / batch)
    assert seconds >= presses * press_s / workers
    assert seconds >= shards * BESIDE.client_s
    assert row.core_hours == pytest.approx(row.hours * workers)
    assert 0 < row.efficiency <= 1 + 1e-12
    assert row.tasks_s == pytest.approx(shards / seconds)
    assert row.files_mb_s == pytest.approx(presses * COST.file_bytes / 1e6 / seconds)
    assert row.network_kb_s == pytest.approx(shards * BESIDE.task_bytes / 1e3 / seconds)
    if workers < 0.5 * row.most_workers and shards > 2 * workers:
        assert row.limit == "workers"


def test_the_scheduler_rules_from_the_workers_that_are_told() -> None:
    edge = planned(COST, BESIDE, 1).most_workers
    # 500 batches a second, of 100 presses of 20.1 ms and a file of 5 ms each
    assert edge == pytest.approx(500 * (100 * 0.0201 + 0.005))
    assert planned(COST, BESIDE, math.floor(0.9 * edge), presses=10**8).limit == "workers"
    over = planned(COST, BESIDE, math.ceil(1.1 * edge), presses=10**8)
    assert over.limit == "scheduler"
    assert over.hours == pytest.approx((2.0 + 10**6 * 2e-3) / 3600)
    few = planned(COST, BESIDE, 512, presses=51_300)  # 513 batches: one worker takes a second one
    assert 3600 * few.hours == pytest.approx(2.0 + 2 * (100 * 0.0201 + 0.005))


def test_a_plan_has_a_row_for_each_press_and_number_of_workers() -> None:
    plan = ClusterPlan(costs=(COST, replace(COST, model="finite", seconds=2.5)), overheads=BESIDE)
    rows = list(plan.rows((8, 64)))
    assert [(row.model, row.workers) for row in rows] == [("flat", 8), ("flat", 64), ("finite", 8), ("finite", 64)]


def test_efficiency_is_the_share_of_so_many_times_one_worker(tmp_path: Path) -> None:
    line = Line(name="busy", unit="presses/s", size=(1.0, 2.0), value=(90.0, 144.0))
    assert list(efficiency(line)) == pytest.approx([1.0, 0.8])
    curve = Curve(title="Sweep", size_name="workers", lines=(line,))
    draw([curve, replace(curve, title="Store")], tmp_path / "scaling.png")
    with Image.open(tmp_path / "scaling.png") as picture:
        assert np.asarray(picture.convert("L")).std() > 5


def test_a_narrow_box_lies_in_the_middle_of_the_default() -> None:
    assert boxed(dict.fromkeys(VARIED, 1.0)) == Box()
    narrow = boxed(dict.fromkeys(VARIED, 0.25))
    for name in VARIED:
        (low, high), (least, most) = getattr(narrow, name), getattr(Box(), name)
        assert low * high == pytest.approx(least * most)
        assert math.log(high / low) == pytest.approx(0.25 * math.log(most / least))


def test_a_sweep_s_plan_is_of_the_model_that_was_asked_for() -> None:
    plan = sweep_plan(250, batch=100, probe="tsis-domed", strain="finite", force_n=0.75)
    assert (plan.presses, plan.shards, plan.strain, plan.forces_n) == (250, 3, "finite", (0.75,))
    assert plan.probe.name == "tsis-domed"
