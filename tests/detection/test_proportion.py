"""Intervals of shares beside statsmodels' and SciPy's, and their true coverage from the binomial law."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom, binomtest
from statsmodels.stats.proportion import proportion_confint

from tsis.errors import InputError
from tsis.study.proportions import Proportion, exact_interval, wilson_interval

CASES = [(0, 1), (1, 1), (0, 8), (3, 8), (6, 8), (7, 8), (8, 8), (50, 1000), (999, 1000)]
counted = st.integers(1, 2000).flatmap(lambda trials: st.tuples(st.integers(0, trials), st.just(trials)))


@pytest.mark.parametrize("level", [0.5, 0.9, 0.95, 0.999])
@pytest.mark.parametrize(("successes", "trials"), CASES)
def test_intervals_are_those_of_others(successes: int, trials: int, level: float) -> None:
    wilson, exact = wilson_interval(successes, trials, level), exact_interval(successes, trials, level)
    assert list(wilson) == pytest.approx(proportion_confint(successes, trials, 1 - level, "wilson"), abs=1e-12)
    assert list(exact) == pytest.approx(proportion_confint(successes, trials, 1 - level, "beta"), abs=1e-12)
    peer = binomtest(successes, trials).proportion_ci(level, "exact")
    assert list(exact) == pytest.approx([peer.low, peer.high], abs=1e-9)
    assert (wilson.method, exact.method, wilson.level) == ("wilson", "exact", level)


@given(counted, st.floats(0.01, 0.999))
def test_an_interval_holds_the_share_and_stays_a_share(pair: tuple[int, int], level: float) -> None:
    share = Proportion(successes=pair[0], trials=pair[1])
    swapped = Proportion(successes=pair[1] - pair[0], trials=pair[1])
    for method in ("wilson", "exact"):
        interval = share.interval(level, method)
        assert 0 <= interval.low <= interval.high <= 1
        assert interval.holds(share.value)
        other = swapped.interval(level, method)
        assert [1 - other.high, 1 - other.low] == pytest.approx(list(interval), abs=1e-10)


@pytest.mark.parametrize("trials", [3, 8, 30])
def test_true_coverage_from_the_binomial_law(trials: int) -> None:
    truths = np.linspace(0.005, 0.995, 199)
    weights = binom.pmf(np.arange(trials + 1)[:, None], trials, truths)
    held = {}
    for method in ("wilson", "exact"):
        ends = [Proportion(successes=k, trials=trials).interval(0.95, method) for k in range(trials + 1)]
        inside = np.array([[one.holds(truth) for truth in truths] for one in ends])
        held[method] = (weights * inside).sum(axis=0)
    assert held["exact"].min() >= 0.95 - 1e-12
    assert held["wilson"].mean() == pytest.approx(0.95, abs=0.02)


@pytest.mark.parametrize(
    ("successes", "trials", "said"),
    [
        (1, 0, "trials must lie in"),
        (-1, 8, r"successes must lie in \[0, 8\]; got -1"),
        (9, 8, "of 8 trials"),
        (0.5, 8, "successes must be a whole number"),
        (True, 8, "successes must be a whole number"),
        (1, math.nan, "trials must be a whole number"),
    ],
)
def test_what_is_no_share_is_told(successes: int, trials: int, said: str) -> None:
    for call in (wilson_interval, exact_interval):
        with pytest.raises(InputError, match=said):
            call(successes, trials)


@pytest.mark.parametrize("level", [0.0, 1.0, -0.5, 95, math.nan])
def test_a_level_is_a_probability(level: float) -> None:
    for method in ("wilson", "exact"):
        with pytest.raises(InputError, match="level must lie in"):
            Proportion(successes=1, trials=2).interval(level, method)


def test_an_unknown_method_is_told() -> None:
    with pytest.raises(InputError, match="method must be one of wilson, exact; got 'wald'"):
        Proportion(successes=1, trials=2).interval(method="wald")
    with pytest.raises(InputError, match="method must be one of wilson, exact; got array"):
        Proportion(successes=1, trials=2).interval(method=np.zeros(2))  # type: ignore[arg-type]
