"""A frame: unit size about the origin, and back."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.matching.methods import NormalFrame


@pytest.mark.parametrize("dimension", [2, 3], ids=["plane", "space"])
@given(seed=st.integers(0, 2**31), size=st.sampled_from([1e-9, 1.0, 1e9]), away=st.floats(-1e3, 1e3))
def test_inside_points_are_centred_and_of_unit_size(dimension: int, seed: int, size: float, away: float) -> None:
    points = size * (np.random.default_rng(seed).normal(size=(9, dimension)) + away)
    frame = NormalFrame.of(points)
    inside = frame.inward(points)
    np.testing.assert_allclose(inside.mean(axis=0), 0.0, atol=1e-9)
    assert np.mean(np.sum(inside**2, axis=1)) == pytest.approx(1.0)
    np.testing.assert_allclose(frame.outward(inside) / size, points / size, atol=1e-9)


def test_moving_and_scaling_leave_nothing_inside() -> None:
    points = np.random.default_rng(0).normal(size=(30, 3))
    moved = 7.0 * points + [1.0, -2.0, 30.0]
    np.testing.assert_allclose(NormalFrame.of(moved).inward(moved), NormalFrame.of(points).inward(points), atol=1e-12)
    assert NormalFrame.of(moved).size == pytest.approx(7 * NormalFrame.of(points).size)
