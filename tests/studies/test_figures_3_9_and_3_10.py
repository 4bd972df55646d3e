"""The study's curves: what its text says of them, and what a layered body must obey."""

from __future__ import annotations

import numpy as np
import pytest
from studies.figures_3_9_and_3_10 import Result, run


@pytest.fixture(scope="module")
def result() -> Result:
    return run()


def test_what_the_study_says(result: Result) -> None:
    depth = result.depth_mm["three layers"] / result.depth_mm["single layer"]
    assert ((depth > 0.65) & (depth < 0.9)).all()
    assert (np.diff(depth) > 0).all(), "the stiff skin matters most at small forces"
    contact = result.contact_area_mm2["three layers"] / result.contact_area_mm2["single layer"]
    assert ((contact > 0.52) & (contact < 0.68)).all()
    assert result.growth(result.contact_area_mm2, "three layers") == pytest.approx(0.73, abs=0.01)
    assert result.growth(result.contact_area_mm2, "single layer") == pytest.approx(0.65, abs=0.01)
    seen = result.seen_area_mm2["three layers"] - result.seen_area_mm2["single layer"]
    assert seen[2] > 0 > seen[-1]


def test_curves_rise_with_the_force(result: Result) -> None:
    for curves in (result.depth_mm, result.contact_area_mm2, result.seen_area_mm2):
        for curve in curves.values():
            assert (np.diff(curve) > 0).all()
