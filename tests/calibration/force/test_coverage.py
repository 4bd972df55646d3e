from __future__ import annotations

import numpy as np
import pytest
from benchmarks.calibration_force import coverage, one_run

RUNS = 60
QUANTITIES = {
    "intercept",
    "slope",
    "read noise",
    "shot noise",
    "gain",
    "hysteresis",
    "saturation",
    "force of a new frame",
}


@pytest.mark.slow
def test_intervals_of_a_whole_calibration_hold_the_truth() -> None:
    trials = [one for seed in range(RUNS) for one in one_run(np.random.default_rng(9000 + seed))]
    found = coverage(trials)
    assert set(found) == QUANTITIES
    for name, (share, count, width) in found.items():
        assert count >= RUNS
        # 52 of 60 or fewer at 95 % have a chance of 1 in 100; intervals that are useless are no answer
        assert share >= 52 / 60, name
        assert width < 5 or name == "intercept", name
    assert found["force of a new frame"][2] < 0.06


def test_one_calibration_from_the_first_frame_to_a_new_force() -> None:
    trials = one_run(np.random.default_rng(5))
    assert {one.quantity for one in trials} == QUANTITIES
    forces = [one for one in trials if one.quantity == "force of a new frame"]
    assert all(abs(one.value / one.truth - 1) < 0.06 for one in forces)
    gain = next(one for one in trials if one.quantity == "gain")
    assert gain.value == pytest.approx(gain.truth, rel=0.03)
