"""Drift of the lamps: its mean is the warm-up, its spread grows with the root of the time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tsis.errors import InputError
from tsis.imaging.sensor import LedDrift

TIMES = np.array([0.0, 60.0, 900.0, 3600.0])


def test_warming_up_settles_exponentially() -> None:
    factors = LedDrift(warm_up=0.2, warm_up_s=100.0, wander=0.0).factors(TIMES, np.random.default_rng(1))
    np.testing.assert_allclose(factors - 1, 0.2 * np.exp(-TIMES / 100.0), rtol=1e-12, atol=1e-15)


def test_the_walk_spreads_with_the_root_of_the_time() -> None:
    rng = np.random.default_rng(2)
    paths = np.log([LedDrift(warm_up=0.0, wander=0.02).factors(TIMES, rng) for _ in range(4000)])
    np.testing.assert_allclose(paths.std(axis=0), 0.02 * np.sqrt(TIMES / 3600), rtol=0.06)
    np.testing.assert_allclose(paths.mean(axis=0), 0.0, atol=5 * 0.02 / np.sqrt(4000))
    later = paths[:, 3] - paths[:, 2]
    assert abs(np.corrcoef(later, paths[:, 2])[0, 1]) < 5 / np.sqrt(4000), "steps are independent"


def test_the_seed_decides() -> None:
    drift = LedDrift()
    one, same, other = (drift.factors(TIMES, np.random.default_rng(seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert (one[1:] != other[1:]).all()


@pytest.mark.parametrize("times", [[-1.0, 2.0], [3.0, 2.0], [float("nan")], []])
def test_times_that_are_none(times: Any) -> None:
    with pytest.raises(InputError, match="time_s must"):
        LedDrift().factors(times, np.random.default_rng(1))


@pytest.mark.parametrize("changes", [{"warm_up": -0.1}, {"warm_up_s": 0.0}, {"wander": 2.0}, {"wander": float("inf")}])
def test_what_a_drift_refuses(changes: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=f"{next(iter(changes))} must lie in"):
        LedDrift(**changes)
