"""Control charts beside published run lengths, a simulation of alarms, and a plain recomputation of the limits."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import norm, t

from tsis.errors import InputError
from tsis.study.drift import control_chart, ewma_run_length, shewhart_run_length

# Lucas and Saccucci, Technometrics 32 (1990), as in Montgomery's table: weight and width, then lengths by shift.
SHIFTS = (0.0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0)
PUBLISHED = {
    (0.40, 3.054): (500, 224, 71.2, 28.4, 14.3, 5.9, 3.5, 2.0),
    (0.25, 2.998): (500, 170, 48.2, 20.1, 11.1, 5.5, 3.6, 2.3),
    (0.20, 2.962): (500, 150, 41.8, 18.2, 10.5, 5.5, 3.7, 2.4),
    (0.10, 2.814): (500, 106, 31.3, 15.9, 10.3, 6.1, 4.4, 2.9),
    (0.05, 2.615): (500, 84.1, 28.8, 16.4, 11.4, 7.1, 5.2, 3.5),
}


@pytest.mark.parametrize(("rule", "lengths"), PUBLISHED.items())
def test_run_lengths_are_those_of_the_published_table(rule: tuple[float, float], lengths: tuple[float, ...]) -> None:
    found = [ewma_run_length(shift, weight=rule[0], width=rule[1]) for shift in SHIFTS]
    assert found == pytest.approx(lengths, rel=0.007, abs=0.06)
    assert ewma_run_length(-1.0, weight=rule[0], width=rule[1]) == pytest.approx(found[4], rel=1e-9)


def test_run_lengths_are_those_of_a_simulation() -> None:
    rng, weight, width, shift = np.random.default_rng(8), 0.3, 2.4, 0.7
    half, runs = width * math.sqrt(weight / (2 - weight)), np.zeros(4000)
    ewma, alive = np.zeros(4000), np.ones(4000, dtype=bool)
    while alive.any():
        ewma = (1 - weight) * ewma + weight * (shift + rng.standard_normal(4000))
        runs += alive
        alive &= np.abs(ewma) <= half
    error = runs.std() / math.sqrt(len(runs))
    assert abs(ewma_run_length(shift, weight=weight, width=width) - runs.mean()) < 4 * error


def test_shewhart_run_lengths_are_those_of_independent_alarms() -> None:
    assert shewhart_run_length(0.0) == pytest.approx(1 / (2 * norm.sf(3)), rel=1e-12)
    assert shewhart_run_length(1.5) == pytest.approx(14.97, abs=0.01)  # Montgomery
    assert ewma_run_length(0.8, weight=1.0, width=3.0) == pytest.approx(shewhart_run_length(0.8), rel=1e-6)


def test_limits_follow_their_formulas() -> None:
    rng = np.random.default_rng(3)
    values = 5 + 0.2 * rng.standard_normal(30)
    chart = control_chart(values, baseline=12)
    spread = values[:12].std(ddof=1)
    assert chart.shewhart == pytest.approx(t.isf(norm.sf(3), 11) * spread * math.sqrt(13 / 12), rel=1e-9)
    weights = np.array([0.2 * 0.8 ** (17 - index) for index in range(18)])  # of the values after the baseline
    own = weights @ values[12:] + 0.8**18 * chart.centre
    assert chart.ewma[-1] == pytest.approx(own, rel=1e-12)
    variance = (weights**2).sum() + weights.sum() ** 2 / 12  # of the values, and of the centre that is subtracted
    assert chart.ewma_half[-1] == pytest.approx(t.isf(norm.sf(2.962), 11) * spread * math.sqrt(variance), rel=1e-9)


def test_a_short_baseline_warns_falsely_as_seldom_as_a_long_one() -> None:
    rng = np.random.default_rng(4)
    values = rng.standard_normal((40_000, 9))
    beyond = [control_chart(row, baseline=8).beyond_shewhart[-1] for row in values[:4000]]
    spread = values[:, :8].std(axis=1, ddof=1)
    far = np.abs(values[:, 8] - values[:, :8].mean(axis=1)) > spread * t.isf(norm.sf(3), 7) * math.sqrt(9 / 8)
    assert beyond == far[:4000].tolist()
    assert far.mean() == pytest.approx(2 * norm.sf(3), abs=4 * math.sqrt(0.0027 / 40_000))
    assert (np.abs(values[:, 8] - values[:, :8].mean(axis=1)) > 3 * spread).mean() > 4 * far.mean()  # naive limits


def test_a_slow_drift_is_seen_before_a_value_leaves() -> None:
    rng = np.random.default_rng(6)
    drift = np.concatenate([np.zeros(20), 0.1 * np.arange(1, 41)])
    chart = control_chart(rng.standard_normal(60) + drift, baseline=20)
    assert chart.first_warning is not None
    assert 20 <= chart.first_warning < 50
    assert not chart.beyond_shewhart[:20].any()


@pytest.mark.parametrize(
    ("values", "options", "message"),
    [
        (np.ones(9), {"baseline": 8}, "values of the baseline must differ"),
        (np.arange(7.0), {"baseline": 8}, "values must be at least the 8 of the baseline; got 7"),
        (np.arange(9.0), {"baseline": 3}, "baseline must"),
        (np.arange(9.0), {"baseline": 8, "weight": 0.0}, "weight must lie in"),
    ],
)
def test_bad_input_is_refused(values: np.ndarray, options: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        control_chart(values, **options)  # type: ignore[arg-type]
