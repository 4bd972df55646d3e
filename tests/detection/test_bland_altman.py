"""Bias and limits of agreement beside SciPy and R, and how often their intervals hold."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import linregress, nct, ttest_rel
from tests.detection.references import REFERENCES

from tsis.errors import InputError
from tsis.study.agreement import bland_altman


def _pair(seed: int, size: int, growth: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    first = rng.normal(10, 3, size)
    return first, first * (1 - growth) + rng.normal(0.3, 0.5, size)


@pytest.mark.parametrize("size", [3, 10, 200])
def test_bias_and_slope_are_those_of_scipy(size: int) -> None:
    first, second = _pair(1, size, growth=0.1)
    found = bland_altman(first, second)
    peer = ttest_rel(first, second).confidence_interval(0.9)
    assert list(found.bias_interval(0.9)) == pytest.approx([peer.low, peer.high], abs=1e-10)
    line, own = linregress((first + second) / 2, first - second), found.proportional
    assert [own.slope, own.intercept] == pytest.approx([line.slope, line.intercept], abs=1e-9)
    assert own.standard_error == pytest.approx(line.stderr, rel=1e-8)
    assert own.p == pytest.approx(line.pvalue, rel=1e-6, abs=1e-12)
    assert own.interval().holds(own.slope)


@pytest.mark.parametrize("row", REFERENCES["noncentral_t"])
def test_quantiles_of_the_noncentral_t_are_those_of_r(row: list[float]) -> None:
    probability, free, noncentral, result = row
    assert nct.ppf(probability, free, noncentral) == pytest.approx(result, rel=2e-7)  # R's are no better


def test_limits_by_hand() -> None:
    found = bland_altman([1.0, 2.0, 4.0, 8.0], [2.0, 1.0, 5.0, 6.0])
    differences = np.array([-1.0, 1.0, -1.0, 2.0])
    away = 1.959964 * differences.std(ddof=1)
    assert found.limits() == pytest.approx((0.25 - away, 0.25 + away), rel=1e-6)
    lower, upper = found.limit_intervals(method="approximate")
    half = 3.182446 * differences.std(ddof=1) * np.sqrt(1 / 4 + 1.959964**2 / 6)  # Student's t of 3
    assert list(upper) == pytest.approx([0.25 + away - half, 0.25 + away + half], rel=1e-6)
    assert list(lower) == pytest.approx([0.25 - away - half, 0.25 - away + half], rel=1e-6)


@pytest.mark.parametrize("size", [3, 8, 30])
def test_exact_intervals_of_limits_hold_as_often_as_they_say(size: int) -> None:
    rng = np.random.default_rng(3)
    held = []
    for differences in rng.normal(size=(800, size)):
        lower, upper = bland_altman(differences, np.zeros(size)).limit_intervals(0.9)
        held.append([lower.holds(-1.959964), upper.holds(1.959964)])
    assert np.mean(held, axis=0) == pytest.approx(0.9, abs=0.035)


def test_approximate_intervals_come_near_exact_ones_for_many() -> None:
    found = bland_altman(*_pair(4, 2000))
    for exact, near in zip(found.limit_intervals(), found.limit_intervals(method="approximate"), strict=True):
        assert list(exact) == pytest.approx(list(near), abs=0.05 * (near.high - near.low))
        assert (exact.method, near.method) == ("exact", "approximate")


@given(st.integers(0, 2**32), st.integers(5, 30))
def test_swapping_the_ways_turns_everything(seed: int, size: int) -> None:
    first, second = _pair(seed, size)
    one, two = bland_altman(first, second), bland_altman(second, first)
    assert one.bias == -two.bias
    assert one.limits() == pytest.approx(tuple(-limit for limit in two.limits()[::-1]))
    lower, upper = one.limit_intervals()
    assert lower.low < one.limits()[0] < lower.high
    assert [-end for end in two.limit_intervals()[0]][::-1] == pytest.approx(list(upper))
    assert one.proportional.slope == pytest.approx(-two.proportional.slope)
    assert one.proportional.p == pytest.approx(two.proportional.p)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: bland_altman([1.0], [2.0]), "differences must be at least 2 to have a spread; got 1"),
        (lambda: bland_altman([1.0, 2.0], [2.0]), "first and second must be equally long"),
        (lambda: bland_altman([1.0, np.inf], [2.0, 1.0]), "first must be finite"),
        (lambda: bland_altman([], []), "first must not be empty"),
        (lambda: bland_altman([1.0, 2.0], [2.0, 3.0]).bias_interval(), "differences must vary for an interval; got 2"),
        (lambda: bland_altman([1.0, 2.0], [2.0, 3.0]).limit_intervals(), "differences must vary for an interval"),
        (lambda: bland_altman([1.0, 2.0], [2.0, 3.0]).proportional, "means must be at least 3 and differ"),
        (lambda: bland_altman([1.0, 2.0, 3.0], [3.0, 2.0, 1.0]).proportional, "from 2 to 2"),
        (lambda: bland_altman([1.0, 2.0], [2.0, 1.0]).limits(95), "coverage must lie in"),
        (
            lambda: bland_altman([1.0, 2.0], [2.0, 1.0]).limit_intervals(method="t"),
            "method must be one of exact",
        ),
    ],
)
def test_bad_pairs_are_told(call: Any, said: str) -> None:
    with pytest.raises(InputError, match=said):
        call()


def test_equal_differences_have_limits() -> None:
    assert bland_altman([1.0, 2.0], [2.0, 3.0]).limits() == (-1.0, -1.0)
    line = bland_altman([2.0, 3.0, 4.0], [1.0, 2.0, 3.0]).proportional
    assert (line.slope, line.p) == (0.0, 1.0)
