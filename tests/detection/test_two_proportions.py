"""Ratios and differences of shares beside statsmodels'."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.stats import binom
from statsmodels.stats.proportion import confint_proportions_2indep

from tsis.errors import InputError
from tsis.study.proportions import Proportion, ProportionDifference, ProportionRatio

shares = st.integers(1, 60).flatmap(
    lambda trials: st.builds(Proportion, successes=st.integers(0, trials), trials=st.just(trials))
)
CASES = [(6, 8, 1, 8), (7, 8, 2, 9), (1, 30, 20, 25), (40, 50, 41, 50), (1, 8, 7, 8)]


@pytest.mark.parametrize("level", [0.8, 0.95, 0.99])
@pytest.mark.parametrize("counts", CASES)
def test_intervals_are_those_of_statsmodels(counts: tuple[int, int, int, int], level: float) -> None:
    first = Proportion(successes=counts[0], trials=counts[1])
    second = Proportion(successes=counts[2], trials=counts[3])
    ratio, difference = ProportionRatio(first=first, second=second), ProportionDifference(first=first, second=second)
    peer = confint_proportions_2indep(*counts, compare="ratio", method="score", alpha=1 - level, correction=False)
    assert list(ratio.interval(level)) == pytest.approx(peer, rel=1e-6)  # they search by steps
    peer = confint_proportions_2indep(*counts, compare="diff", method="newcomb", alpha=1 - level)
    assert list(difference.interval(level)) == pytest.approx(peer, abs=1e-12)


@given(shares, shares)
def test_swapping_the_shares_inverts_the_ratio_and_turns_the_difference(one: Proportion, two: Proportion) -> None:
    turned = ProportionDifference(first=two, second=one).interval()
    straight = ProportionDifference(first=one, second=two).interval()
    assert [-turned.high, -turned.low] == pytest.approx(list(straight), abs=1e-12)
    assert -1 <= straight.low <= straight.high <= 1
    assume(one.successes + two.successes > 0)
    ratio, inverse = ProportionRatio(first=one, second=two), ProportionRatio(first=two, second=one)
    low, high = ratio.interval()
    assert low <= ratio.value <= high
    back = inverse.interval()
    assert low == pytest.approx(1 / back.high, rel=1e-9)
    assert high == pytest.approx(1 / back.low if back.low else math.inf, rel=1e-9)


@pytest.mark.parametrize(("one", "two"), [(0.75, 0.125), (0.9, 0.3)])
def test_true_coverage_of_eight_and_eight(one: float, two: float) -> None:
    weights = np.outer(binom.pmf(np.arange(9), 8, one), binom.pmf(np.arange(9), 8, two))
    held = np.zeros((2, 9, 9))
    for x, y in np.ndindex(9, 9):
        first, second = Proportion(successes=x, trials=8), Proportion(successes=y, trials=8)
        held[0, x, y] = ProportionDifference(first=first, second=second).interval().holds(one - two)
        held[1, x, y] = (x + y) > 0 and ProportionRatio(first=first, second=second).interval().holds(one / two)
    assert (held * weights).sum(axis=(1, 2)) == pytest.approx(0.95, abs=0.035)


def test_shares_of_none_and_all() -> None:
    none, every = Proportion(successes=0, trials=8), Proportion(successes=8, trials=8)
    endless = ProportionRatio(first=every, second=none)
    assert endless.value == math.inf
    assert endless.interval().high == math.inf
    assert endless.interval().low > 1
    assert ProportionRatio(first=none, second=every).interval().low == 0.0
    assert ProportionRatio(first=every, second=every).interval().holds(1.0)
    many = Proportion(successes=10**12, trials=10**12)
    assert ProportionRatio(first=Proportion(successes=0, trials=10**12), second=many).interval(1e-6).high < 1e-12
    with pytest.raises(InputError, match="first or second must count at least one"):
        ProportionRatio(first=none, second=none)
