"""Variance components and linearity beside statsmodels, Cochran's limits beside ISO 5725-2, study sizes simulated."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
import pytest
import statsmodels.api as sm
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import f_oneway
from statsmodels.formula.api import ols
from statsmodels.stats.anova import anova_lm

from tsis.errors import InputError
from tsis.study.precision import linearity, repeatability, reproducibility, study_size


def _study(seed: int, shape: tuple[int, int, int], sds: tuple[float, float, float, float]) -> np.ndarray:
    rng = np.random.default_rng(seed)
    n, k, _ = shape
    sizes = ((n, 1, 1), (1, k, 1), (n, k, 1), shape)
    total: np.ndarray = np.sum(
        [sd * rng.normal(size=size) + np.zeros(shape) for sd, size in zip(sds, sizes, strict=True)], axis=0
    )
    return total


@pytest.mark.parametrize("sizes", [(3, 3, 3, 3), (1, 5, 2, 7), (2, 1, 1, 1)])
def test_the_one_way_components_are_those_of_scipys_f(sizes: tuple[int, ...]) -> None:
    rng = np.random.default_rng(1)
    rows = [rng.normal(3 * rng.normal(), 0.5, size) for size in sizes]
    found = repeatability(rows)
    within = sum(((row - row.mean()) ** 2).sum() for row in rows) / (sum(sizes) - len(sizes))
    assert found.within_sd == pytest.approx(math.sqrt(within), rel=1e-10)
    size = (sum(sizes) - sum(one**2 for one in sizes) / sum(sizes)) / (len(sizes) - 1)
    peer = f_oneway(*rows).statistic
    assert 1 + size * (found.between_sd / found.within_sd) ** 2 == pytest.approx(peer, rel=1e-9)
    assert not found.between_truncated


def test_the_coefficient_is_of_two_readings() -> None:
    rng = np.random.default_rng(2)
    found = repeatability([rng.normal(target, 0.4, 2) for target in range(4000)])
    pairs = rng.normal(0, 0.4, (20_000, 2))
    assert np.mean(np.abs(pairs[:, 0] - pairs[:, 1]) < found.coefficient) == pytest.approx(0.95, abs=0.01)
    assert found.coefficient == pytest.approx(2.77 * found.within_sd, rel=1e-3)


def test_intervals_of_repeatability_hold_as_often_as_they_say() -> None:
    rng = np.random.default_rng(3)
    truth = 2.7718 * 0.5
    held = [
        repeatability([rng.normal(target, 0.5, size) for target, size in enumerate((2, 3, 1, 4))])
        .interval(0.9)
        .holds(truth)
        for _ in range(800)
    ]
    assert np.mean(held) == pytest.approx(0.9, abs=0.035)


def test_targets_that_do_not_differ_have_no_negative_variance() -> None:
    found = repeatability([[1.0, 2.0], [2.0, 1.0], [1.0, 2.0]])
    assert found.between_truncated
    assert found.between_sd == 0


@pytest.mark.parametrize("shape", [(5, 3, 2), (2, 2, 2), (8, 4, 3)])
def test_the_two_way_components_are_those_of_statsmodels(shape: tuple[int, int, int]) -> None:
    table = _study(5, shape, (3, 2, 0.8, 0.2)) + 50
    found = reproducibility(table)
    target, operator, _ = np.indices(shape)
    frame = pd.DataFrame({"y": table.ravel(), "t": target.ravel(), "o": operator.ravel()})
    peer = anova_lm(ols("y ~ C(t) * C(o)", frame).fit())
    assert found.mean_squares == pytest.approx(tuple(peer["mean_sq"]), rel=1e-9)
    assert found.degrees_of_freedom == tuple(peer["df"])
    n, k, r = shape
    expected = (
        found.repeat_sd**2 + r * found.interaction_sd**2 + k * r * found.target_sd**2,
        found.repeat_sd**2 + r * found.interaction_sd**2 + n * r * found.operator_sd**2,
        found.repeat_sd**2 + r * found.interaction_sd**2,
    )
    assert found.truncated == ()
    assert expected == pytest.approx(found.mean_squares[:3])
    total = found.repeat_sd**2 + found.interaction_sd**2 + found.operator_sd**2
    assert found.coefficient == pytest.approx(1.959964 * math.sqrt(2 * total), rel=1e-6)


@pytest.mark.parametrize("sds", [(3.0, 0.5, 0.2, 0.4), (3.0, 0.0, 0.0, 0.4), (0.0, 2.0, 0.0, 0.1)])
def test_intervals_of_reproducibility_hold_as_often_as_they_say(sds: tuple[float, float, float, float]) -> None:
    truth = 1.959964 * math.sqrt(2 * sum(sd**2 for sd in sds[1:]))
    within = 1.959964 * math.sqrt(2) * sds[3]
    found = [reproducibility(_study(seed, (6, 4, 2), sds)) for seed in range(600)]
    assert np.mean([one.interval(0.9).holds(truth) for one in found]) == pytest.approx(0.9, abs=0.045)
    assert np.mean([one.repeatability_interval(0.9).holds(within) for one in found]) == pytest.approx(0.9, abs=0.04)


@given(st.integers(0, 2**32))
def test_swapping_operators_changes_nothing(seed: int) -> None:
    table = _study(seed, (4, 3, 2), (2, 1, 0.5, 0.3))
    rng = np.random.default_rng(seed)
    found = reproducibility(table)
    for other in (table[:, ::-1], rng.permutation(table, axis=0), table[:, :, ::-1], table + 7):
        again = reproducibility(other)
        assert again.coefficient == pytest.approx(found.coefficient, rel=1e-9)
        assert again.repeatability_coefficient == pytest.approx(found.repeatability_coefficient, rel=1e-9)
        assert again.truncated == found.truncated


def test_operators_alike_are_said_to_be_cut() -> None:
    found = reproducibility([[[1.0, 2.0], [2.0, 1.0]], [[4.0, 5.0], [5.0, 4.0]]])
    assert found.truncated == ("interaction",)
    assert found.interaction_sd == 0
    assert found.coefficient > 0


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: repeatability([]), "readings must hold at least 2 targets, one of them read twice; got 0"),
        (lambda: repeatability([[1.0, 2.0]]), "got 1 of at most 2 readings"),
        (lambda: repeatability([[1.0], [2.0]]), "got 2 of at most 1 readings"),
        (lambda: repeatability([[1.0, 2.0], []]), r"readings\[1\] must not be empty"),
        (lambda: repeatability([[1.0, 2.0], [np.nan]]), r"readings\[1\] must be finite"),
        (lambda: repeatability([[0.1, 0.1, 0.1], [0.7, 0.7, 0.7]]).interval(), "readings must differ between repeats"),
        (lambda: reproducibility(np.ones((2, 1, 2))), "at least 2 targets, operators and repeats; got shape"),
        (lambda: reproducibility(np.ones((2, 2))), "readings must have 3 axes"),
        (lambda: reproducibility(np.full((2, 2, 2), 0.1)).interval(), "readings must differ between repeats"),
        (lambda: reproducibility(np.full((2, 2, 2), 0.1)).repeatability_interval(), "readings must differ between"),
    ],
)
def test_bad_studies_are_told(call: Any, said: str) -> None:
    with pytest.raises(InputError, match=said):
        call()


def test_the_line_and_its_parabola_are_those_of_statsmodels() -> None:
    rng = np.random.default_rng(81)
    true = rng.uniform(3.0, 15.0, 17)
    measured = 0.4 + 0.93 * true + 0.01 * true**2 + 0.2 * rng.standard_normal(17)
    found = linearity(measured, true)
    line = sm.OLS(measured, sm.add_constant(true)).fit()
    assert (found.intercept, found.slope) == pytest.approx(tuple(line.params), rel=1e-9)
    assert (found.intercept_sd, found.slope_sd) == pytest.approx(tuple(line.bse), rel=1e-9)
    assert tuple(found.slope_interval()) == pytest.approx(tuple(line.conf_int()[1]), rel=1e-9)
    assert tuple(found.intercept_interval(0.9)) == pytest.approx(tuple(line.conf_int(0.1)[0]), rel=1e-9)
    assert found.r_squared == pytest.approx(line.rsquared, rel=1e-9)
    assert found.scatter_sd == pytest.approx(np.sqrt(line.mse_resid), rel=1e-9)
    parabola = sm.OLS(measured, np.column_stack([np.ones(17), true, true**2])).fit()
    assert found.curvature_p == pytest.approx(parabola.pvalues[2], rel=1e-6)


def test_a_line_through_exact_readings_has_no_curvature() -> None:
    found = linearity([2.0, 4.0, 6.0, 8.0], [1.0, 2.0, 3.0, 4.0])
    assert found.slope == pytest.approx(2.0)
    assert found.r_squared == pytest.approx(1.0)


@pytest.mark.parametrize("true", [[1.0, 2.0, 3.0], [1.0, 1.0, 2.0, 2.0], [-1.0, 1.0, 2.0, 3.0]])
def test_too_few_or_equal_targets_are_refused(true: list[float]) -> None:
    with pytest.raises(InputError, match="add reference targets"):
        linearity(true, true)


@pytest.mark.parametrize(("targets", "repeats", "printed"), [(8, 3, 0.516), (20, 3, 0.270), (10, 2, 0.602)])
def test_cochran_limits_are_those_printed_in_iso_5725_2(targets: int, repeats: int, printed: float) -> None:
    rows = np.random.default_rng(5).standard_normal((targets, repeats)) + 10.0
    found = repeatability(list(rows))
    assert found.cochran_limit == pytest.approx(printed, abs=6e-4)
    variances = rows.var(axis=1, ddof=1)
    assert found.largest_variance_fraction == pytest.approx(variances.max() / variances.sum())


def test_the_coefficient_of_variation_weights_targets_by_their_repeats() -> None:
    rows = [[9.0, 11.0], [20.0, 20.0, 23.0]]
    squares = [np.var(row, ddof=1) / np.mean(row) ** 2 for row in rows]
    found = repeatability(rows)
    assert found.within_cv == pytest.approx(np.sqrt((squares[0] + 2 * squares[1]) / 3))
    assert (found.largest_variance_fraction, found.cochran_limit) == (None, None)
    assert repeatability([[-1.0, 1.0], [2.0, 3.0]]).within_cv is None


@pytest.mark.parametrize(("operators", "repeats", "operator_sd"), [(5, 3, 0.4), (10, 2, 0.8)])
def test_simulated_studies_of_a_planned_size_reach_their_width(
    operators: int, repeats: int, operator_sd: float
) -> None:
    planned = study_size(0.9, operators=operators, repeats=repeats, operator_sd=operator_sd, reproducibility_too=True)
    assert planned.phantoms is not None
    rng = np.random.default_rng(20)
    within, between = [], []
    for _ in range(300):
        table = rng.standard_normal((planned.phantoms, operators, repeats))
        table += operator_sd * rng.standard_normal((1, operators, 1)) + 3 * rng.standard_normal(
            (planned.phantoms, 1, 1)
        )
        found = reproducibility(table)
        within.append(found.repeatability_interval().high / (found.repeatability_coefficient))
        between.append((found.interval().high / found.coefficient) - 1)
    assert np.median(within) - 1 == pytest.approx(planned.upper_repeatability, rel=1e-9)  # a ratio without chance
    assert np.median(between) == pytest.approx(planned.upper_reproducibility, rel=0.15)


def test_one_phantom_fewer_misses_the_width() -> None:
    planned = study_size(0.2, operators=2, repeats=3)
    assert planned.phantoms is not None
    fewer = np.random.default_rng(3).standard_normal((planned.phantoms - 1, 2, 3))
    found = reproducibility(fewer)
    assert found.repeatability_interval().high / found.repeatability_coefficient - 1 > 0.2
    assert planned.upper_repeatability <= 0.2
    assert planned.presses == planned.phantoms * 6


def test_two_operators_never_tell_how_operators_differ() -> None:
    planned = study_size(0.3, operators=2, repeats=3, operator_sd=0.5, reproducibility_too=True)
    assert (planned.phantoms, planned.presses) == (None, None)
    assert planned.upper_reproducibility > 5
