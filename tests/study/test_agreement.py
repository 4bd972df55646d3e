"""Intraclass correlations beside R's psych; bias and limits of agreement beside SciPy and R; how often they hold."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import f, linregress, nct, ttest_rel
from statsmodels.formula.api import ols
from statsmodels.stats.anova import anova_lm
from tests.study.references import REFERENCES

from tsis.errors import InputError
from tsis.study.agreement import FORMS, MeanSquares, bland_altman, intraclass_correlation

TABLES = REFERENCES["icc"]
OF_PSYCH = dict(zip(FORMS, ("ICC1", "ICC2", "ICC3", "ICC1k", "ICC2k", "ICC3k"), strict=True))


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", sorted(TABLES))
def test_all_forms_are_those_of_psych(name: str, form: str) -> None:
    result = TABLES[name]["forms"][OF_PSYCH[form]]
    found = intraclass_correlation(TABLES[name]["table"], form)
    assert found.value == pytest.approx(result["value"], abs=1e-10)
    assert found.f == pytest.approx(result["f"], rel=1e-10)
    assert found.degrees_of_freedom == (result["df1"], result["df2"])
    assert found.p == pytest.approx(result["p"], rel=1e-8)
    assert list(found.interval()) == pytest.approx(result["interval_95"], abs=1e-10)


def test_the_printed_example_of_shrout_and_fleiss() -> None:
    table = TABLES["shrout_fleiss"]["table"]
    found = MeanSquares.of(table)
    printed = (11.24, 6.26, 32.49, 1.02)  # between targets, within, between judges, residual: their table 3
    assert (found.targets, found.within, found.raters, found.residual) == pytest.approx(printed, abs=0.005)
    values = [intraclass_correlation(table, form).value for form in FORMS]
    assert values == pytest.approx([0.17, 0.29, 0.71, 0.44, 0.62, 0.91], abs=0.005)


def test_mean_squares_are_those_of_statsmodels() -> None:
    rng = np.random.default_rng(1)
    table = rng.normal(size=(9, 4)) + rng.normal(size=(9, 1)) + 100
    frame = pd.DataFrame({"y": table.ravel(), "t": np.repeat(np.arange(9), 4), "r": np.tile(np.arange(4), 9)})
    peer = anova_lm(ols("y ~ C(t) + C(r)", frame).fit())["mean_sq"]
    found = MeanSquares.of(table)
    assert (found.targets, found.raters, found.residual) == pytest.approx(tuple(peer), rel=1e-9)


@given(st.integers(0, 2**32), st.integers(2, 12), st.integers(2, 6))
def test_swapping_raters_moving_and_scaling_change_nothing(seed: int, n: int, k: int) -> None:
    rng = np.random.default_rng(seed)
    table = rng.normal(size=(n, k)) + 3 * rng.normal(size=(n, 1))
    for form in FORMS:
        try:
            found = intraclass_correlation(table, form)
        except InputError:
            continue
        assert found.value <= 1
        for other in (rng.permutation(table, axis=1), rng.permutation(table, axis=0), 5 - 2 * table):
            again = intraclass_correlation(other, form)
            assert again.value == pytest.approx(found.value, rel=1e-6, abs=1e-9)
            assert list(again.interval()) == pytest.approx(list(found.interval()), rel=1e-6, abs=1e-6)


@pytest.mark.parametrize(
    ("form", "rater_sd", "truth"), [("ICC(1,1)", 0.0, 0.8), ("ICC(3,1)", 1.5, 0.8), ("ICC(2,1)", 1.0, 4 / 6)]
)
def test_intervals_hold_as_often_as_they_say(form: str, rater_sd: float, truth: float) -> None:
    rng = np.random.default_rng(2)
    held = 0
    for _ in range(600):
        table = 2 * rng.normal(size=(12, 1)) + rater_sd * rng.normal(size=(1, 5)) + rng.normal(size=(12, 5))
        held += intraclass_correlation(table, form).interval(0.9).holds(truth)
    assert held / 600 == pytest.approx(0.9, abs=0.04)


def test_exact_agreement_is_one_without_an_interval() -> None:
    table = np.array([[0.1, 0.1, 0.1], [0.7, 0.7, 0.7], [0.3, 0.3, 0.3]]) + 0.2
    for form in FORMS:
        found = intraclass_correlation(table, form)
        assert found.value == 1.0
        assert found.p == 0.0
        with pytest.raises(InputError, match="ratings must scatter within targets for an interval"):
            found.interval()


def test_targets_alike_have_no_interval_of_agreement() -> None:
    with pytest.raises(InputError, match=r"ratings must differ more between targets for an interval of .*; got F = 0"):
        intraclass_correlation([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]).interval()


@pytest.mark.parametrize("form", ["ICC(1,1)", "ICC(2,1)", "ICC(3,1)"])
def test_coarse_ratings_have_an_interval_about_their_value_or_a_reason_for_none(form: str) -> None:
    # Every table of 4 targets, 2 raters and 2 grades. Some have a correlation of -1, where the formula was 0/0.
    given, refused = 0, set()
    for grades in itertools.product((0.0, 1.0), repeat=8):
        try:
            found = intraclass_correlation(np.reshape(grades, (4, 2)), form)
            low, high = found.interval()
        except InputError as error:
            refused.add(str(error).split(" for ", maxsplit=1)[0])
            continue
        given += 1
        assert low < found.value < high, grades
    assert given > 100
    assert refused <= {
        "ratings must scatter within targets",
        "ratings must differ between targets",
        "ratings must differ more between targets",
    }


def test_an_interval_with_less_than_one_degree_of_freedom_is_that_of_the_residual() -> None:
    found = intraclass_correlation([[0.0, 1.0], [0.0, 2.0], [0.0, 2.0], [1.0, 1.0]])
    squares = found.mean_squares
    assert found.value == pytest.approx(-4 / 23)
    f_low = f_high = f.ppf(0.975, 3, 3)
    rest = 2 * squares.raters + 2 * squares.residual  # k MSC + (k n - k - n) MSE of the table of McGraw and Wong
    low = 4 * (squares.targets - f_low * squares.residual) / (f_low * rest + 4 * squares.targets)
    high = 4 * (f_high * squares.targets - squares.residual) / (rest + 4 * f_high * squares.targets)
    assert list(found.interval()) == pytest.approx([low, high])


def test_a_mean_of_raters_may_be_bounded_by_nothing_below() -> None:
    found = intraclass_correlation([[2.0, 0.0], [0.0, 2.0], [0.0, 1.0], [0.0, 0.0], [1.0, 1.0]], "ICC(2,k)")
    low, high = found.interval()
    assert low == -math.inf
    assert found.value < high < 1


@pytest.mark.parametrize("scale", [1e-60, 1e60])
def test_the_unit_of_ratings_changes_nothing(scale: float) -> None:
    table = np.array(TABLES["shrout_fleiss"]["table"])
    for form in FORMS:
        plain, scaled = intraclass_correlation(table, form), intraclass_correlation(scale * table, form)
        assert scaled.value == pytest.approx(plain.value)
        assert list(scaled.interval()) == pytest.approx(list(plain.interval()))
    with pytest.raises(InputError, match=r"ratings must lie within ±1e.70; got 1e.101: choose a larger unit"):
        intraclass_correlation(1e100 * table)


@pytest.mark.parametrize(
    ("table", "form", "said"),
    [
        ([[1.0, 2.0]], "ICC(1,1)", "ratings must have at least 2 targets"),
        ([[1.0], [2.0]], "ICC(1,1)", "2 raters .columns.; got 2 and 1"),
        ([1.0, 2.0], "ICC(1,1)", "ratings must have 2 axes"),
        ([[1.0, np.nan], [2.0, 3.0]], "ICC(1,1)", "ratings must be finite"),
        ([[1.0, 2.0], [2.0, 3.0]], "ICC(4,1)", r"form must be one of ICC\(1,1\), .*; got 'ICC\(4,1\)'"),
        ([[1.0, 1.0], [1.0, 1.0]], "ICC(2,1)", r"ratings must differ between targets for ICC\(2,1\)"),
        ([[1.0, 2.0], [1.0, 2.0]], "ICC(3,1)", "ratings must differ between targets"),
        ([[1.0, 2.0], [2.0, 1.0]], "ICC(3,k)", "ratings must differ between targets"),
        ([[1.0, 2.0], [2.0]], "ICC(3,k)", "ratings must be an array of numbers with 2 axes"),
    ],
)
def test_bad_tables_are_told(table: Any, form: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        intraclass_correlation(table, form)


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
