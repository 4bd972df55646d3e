"""Do intervals of 95 % hold the truth as often as they say? Drawn cameras, lenses, boards and balls."""

from __future__ import annotations

import pytest
from benchmarks.calibration_scale import covered
from scipy.stats import binom


@pytest.mark.slow
@pytest.mark.parametrize(("ball", "runs"), [(False, 60), (True, 40)], ids=["dots", "ball"])
def test_intervals_hold_as_often_as_they_say(ball: bool, runs: int) -> None:
    found = covered(runs, 3, ball=ball)
    assert found["refused"] == 0
    few = int(binom.ppf(0.002, runs, 0.95))
    for axis in "xy":
        share = found[f"held {axis} / %"]
        assert isinstance(share, float)
        assert few <= round(share * runs / 100)
    # An interval as wide as the world would hold too.
    uncertainty = found["mean standard uncertainty / %"]
    assert isinstance(uncertainty, float)
    assert uncertainty < (1.5 if ball else 0.2)
