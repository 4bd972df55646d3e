"""Sweeps of a console: begun, cut off, resumed and read; the data set is that of the command line."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.waiting import HANGS_S

from tsis.console.services import FAILED, Jobs, Sweeps, sweep_title, varying_columns
from tsis.console.services import _sweeps as module
from tsis.errors import ControlError, InputError
from tsis.sweep.data_set import read_data_set
from tsis.sweep.plan import load_plan
from tsis.sweep.run import SweepSummary, run_sweep

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

PLAN = """
probe = "tsis-2011"
forces_n = [1.0]
count = 8
seed = 1
batch = 2
[ranges]
diameter_mm = 8.0
depth_mm = [6.0, 10.0]
young_kpa = 100.0
tissue_young_kpa = 5.0
thickness_mm = 40.0
[outputs]
radii_mm = [0.0, 4.0]
columns = ["approach_mm", "pressure_kpa"]
"""


def test_names_and_plans_are_checked_and_a_sweep_runs_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    release: list[Callable[[int, int], None]] = []

    def endless(plan: object, folder: object, *, progress: Callable[[int, int], None], **_: object) -> SweepSummary:
        release.append(progress)
        while True:
            progress(1, 4)

    monkeypatch.setattr(module, "run_sweep", endless)
    jobs = Jobs()
    sweeps = Sweeps(tmp_path, jobs)
    for name, text in (("../out", PLAN), ("", PLAN), ("good", "probe = 3"), ("good", PLAN + "other = 1")):
        with pytest.raises(InputError):
            sweeps.begin(name, text)
    assert sweeps.listed() == ()
    job = sweeps.begin("good", PLAN)
    assert job.title == sweep_title("good")
    (state,) = sweeps.listed()
    assert (state.name, state.presses, state.shards, state.finished, state.complete) == ("good", 8, 4, 0, False)
    with pytest.raises(ControlError, match="already running"):
        sweeps.resume("good")
    with pytest.raises(InputError, match="there is a sweep good already"):
        sweeps.begin("good", PLAN)
    job.end()
    assert job.wait(HANGS_S)
    (tmp_path / "bad.toml").write_text("probe = 1")
    bad, _ = sweeps.listed()
    assert bad.trouble


def test_columns_of_one_value_are_no_axes() -> None:
    rows = {"force_n": [1.0, 1.0], "depth_mm": [6.0, 7.0], "one": [float("nan"), 2.0], "none": [float("nan")] * 2}
    assert varying_columns({name: np.array(values) for name, values in rows.items()}) == ["depth_mm"]


@pytest.mark.system
def test_a_sweep_that_was_ended_resumes_and_is_that_of_the_command(tmp_path: Path) -> None:
    jobs = Jobs()
    sweeps = Sweeps(tmp_path / "console", jobs)
    job = sweeps.begin("first", PLAN)
    while not (state := sweeps.listed()[0]).finished:
        assert job.state().status != FAILED, job.state().sentence
    job.end()
    assert job.wait(HANGS_S)
    part = sweeps.rows("first")
    assert len(part["approach_mm"]) >= 2
    assert state.shards == 4
    again = sweeps.resume("first")
    assert again.wait(HANGS_S)
    assert again.state().sentence.startswith("8 presses in ")
    assert sweeps.listed()[0].complete
    run_sweep(load_plan(tmp_path / "console" / "first.toml"), tmp_path / "other", workers=1)
    other = read_data_set(tmp_path / "other")
    rows = sweeps.rows("first")
    assert np.array_equal(rows["approach_mm"], other["approach_mm"])
    assert np.array_equal(rows["pressure_kpa at r = 0 mm"], other["pressure_kpa"][:, 0])
    assert np.array_equal(part["approach_mm"], other["approach_mm"][: len(part["approach_mm"])])
