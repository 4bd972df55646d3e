"""Intervals of proportions beside statsmodels' and SciPy's, their true coverage, and counts beside scikit-learn's."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.stats import binom, binomtest
from sklearn.metrics import balanced_accuracy_score, class_likelihood_ratios, confusion_matrix, precision_score
from statsmodels.stats.proportion import confint_proportions_2indep, proportion_confint

from tsis.errors import InputError
from tsis.study.proportions import (
    Counts,
    Proportion,
    ProportionDifference,
    ProportionRatio,
    exact_interval,
    wilson_interval,
)

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


shares = st.integers(1, 60).flatmap(
    lambda trials: st.builds(Proportion, successes=st.integers(0, trials), trials=st.just(trials))
)
TWO_CASES = [(6, 8, 1, 8), (7, 8, 2, 9), (1, 30, 20, 25), (40, 50, 41, 50), (1, 8, 7, 8)]


@pytest.mark.parametrize("level", [0.8, 0.95, 0.99])
@pytest.mark.parametrize("counts", TWO_CASES)
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


PRINTED = Counts(true_positives=6, false_negatives=2, true_negatives=7, false_positives=1)


def test_the_printed_study() -> None:
    assert PRINTED.sensitivity.value == 0.75
    assert PRINTED.specificity.value == 0.875
    assert PRINTED.accuracy.value == 13 / 16
    assert PRINTED.youden.value == 0.625
    assert PRINTED.positive_likelihood_ratio.value == pytest.approx(6.0)
    assert PRINTED.negative_likelihood_ratio.value == pytest.approx(0.25 / 0.875)


@given(st.lists(st.tuples(st.booleans(), st.booleans()), min_size=1, max_size=60))
def test_counts_are_those_of_scikit_learn(pairs: list[tuple[bool, bool]]) -> None:
    decided, present = np.array(pairs).T
    counts = Counts.of(decided, present)
    table = confusion_matrix(present, decided, labels=[False, True])
    assert [counts.true_negatives, counts.false_positives] == list(table[0])
    assert [counts.false_negatives, counts.true_positives] == list(table[1])
    assert counts.targets == len(pairs)
    assert counts.accuracy.value == np.mean(decided == present)


@pytest.mark.parametrize("seed", range(5))
def test_rates_are_those_of_scikit_learn(seed: int) -> None:
    rng = np.random.default_rng(seed)
    present = rng.permutation(np.arange(40) < 15)
    decided = present ^ (rng.random(40) < 0.3)
    counts = Counts.of(decided, present)
    assert counts.youden.value == pytest.approx(balanced_accuracy_score(present, decided, adjusted=True))
    assert counts.positive_predictive_value.value == precision_score(present, decided)
    assert counts.negative_predictive_value.value == precision_score(~present, ~decided)
    positive, negative = class_likelihood_ratios(present, decided)
    assert counts.positive_likelihood_ratio.value == pytest.approx(positive)
    assert counts.negative_likelihood_ratio.value == pytest.approx(negative)


@pytest.mark.parametrize(
    ("name", "decided", "present", "said"),
    [
        ("sensitivity", [True], [False], "sensitivity must have at least one target with an inclusion"),
        ("specificity", [True], [True], "specificity must have at least one target without an inclusion"),
        ("positive_predictive_value", [False], [True], "target decided present"),
        ("negative_predictive_value", [True], [True], "target decided absent"),
        ("positive_likelihood_ratio", [True], [True], "target without an inclusion"),
        ("positive_likelihood_ratio", [False, False], [True, False], "first or second must count at least one"),
        ("negative_likelihood_ratio", [True], [False], "target with an inclusion"),
        ("youden", [True], [True], "target without an inclusion"),
    ],
)
def test_what_a_study_cannot_say_names_the_class_that_is_absent(
    name: str, decided: list[bool], present: list[bool], said: str
) -> None:
    counts = Counts.of(decided, present)
    with pytest.raises(InputError, match=said):
        getattr(counts, name)


@pytest.mark.parametrize(
    ("decided", "present", "said"),
    [
        ([], [], "decided must not be empty"),
        ([True], [True, False], "decided and present must be equally long, one value a target; got 1 and 2"),
        ([1, 0], [True, False], "decided must hold True and False alone; got int64 as .*1.*: compare first"),
        ([True, False], [1.0, np.nan], "present must hold True and False alone; got float64"),
        ([True, False], ["yes", "no"], "present must hold True and False alone"),
        ([True, False], [True, None], "present must hold True and False alone"),
        ([[True, False]], [True, False], r"decided must be one row of True and False; got shape \(1, 2\)"),
        (True, [True], r"got shape \(\)"),
        ([[True], [True, False]], [True, False], "rows of unequal lengths"),
        (np.ma.array([True, False], mask=[True, False]), [True, False], "decided must not hold masked values"),
    ],
)
def test_bad_decisions_are_told(decided: object, present: object, said: str) -> None:
    with pytest.raises(InputError, match=said):
        Counts.of(decided, present)  # type: ignore[arg-type]


def test_whole_numbers_of_other_kinds_become_plain_ones() -> None:
    counts = Counts(true_positives=np.int64(6), false_positives=1.0, true_negatives=7, false_negatives=2)  # type: ignore[arg-type]
    assert repr(counts) == repr(PRINTED)
    assert repr(counts.sensitivity) == "Proportion(successes=6, trials=8)"


def test_bad_numbers_are_told() -> None:
    with pytest.raises(InputError, match="at least one target"):
        Counts(true_positives=0, false_positives=0, true_negatives=0, false_negatives=0)
    with pytest.raises(InputError, match="false_positives must lie in"):
        Counts(true_positives=1, false_positives=-1, true_negatives=0, false_negatives=0)
