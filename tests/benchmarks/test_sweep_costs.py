"""What the plan past one machine is computed from, beside a sweep that really runs."""

from __future__ import annotations

import pickle
from typing import TYPE_CHECKING

import numpy as np
import pytest
from benchmarks.curves.workers import sweep_plan
from benchmarks.sweep_costs import _pressed, answered_at_once, pressed_at_once

from tsis.catalog.phantoms import load_phantom
from tsis.catalog.probes import load_probe
from tsis.mechanics import press
from tsis.sweep.shards import encode_shard, press_all, receipt_of, sweep_batches
from tsis.sweep.workers import Finished, SweepJob, finish_batch

if TYPE_CHECKING:
    from pathlib import Path


def test_bytes_of_a_press_are_those_of_a_real_file() -> None:
    seconds, memory_mb, size = _pressed("tsis-2011", "small", 1.0, 3)
    plan = sweep_plan(100)
    whole = encode_shard(
        press_all(plan, next(sweep_batches(sweep_plan(100, batch=25))), press), shard=0, data_set="0" * 64
    )
    # a file of 25 has the same footer over fewer presses
    assert size == pytest.approx(len(whole) / 25, rel=0.35)
    assert size < len(whole) / 25
    assert seconds > 0
    assert memory_mb > 50


def test_a_press_that_costs_nothing_fills_a_file_that_is_whole(tmp_path: Path) -> None:
    plan = sweep_plan(4, batch=2)
    (tmp_path / "manifest.json").touch()
    job = SweepJob(folder=str(tmp_path), plan=plan, data_set="0" * 64, press=pressed_at_once)
    answers = [finish_batch(job, batch) for batch in sweep_batches(plan)]
    assert [isinstance(answer, Finished) and answer.state for answer in answers] == ["computed", "computed"]
    files = sorted(tmp_path.glob("part-*.parquet"))
    assert len(files) == 2
    for number, path in enumerate(files):
        assert receipt_of(path.read_bytes(), shard=number, data_set="0" * 64) is not None
    field = pressed_at_once(load_probe(), load_phantom("size-8"), force_n=2.0, strain="small")
    assert field.force_n == 2.0
    assert np.unique(field.pressure_kpa).size > 200


def test_answers_without_work_name_their_batch() -> None:
    plan = sweep_plan(30)
    job = SweepJob(folder="/", plan=plan, data_set="0" * 64, press=press)
    answers = [pickle.loads(pickle.dumps(answered_at_once(job, batch))) for batch in sweep_batches(plan)]
    assert [answer.receipt.shard for answer in answers] == [0, 1, 2]
    assert [answer.receipt.rows for answer in answers] == [10, 10, 10]
