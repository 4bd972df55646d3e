"""Linearity beside statsmodels, Cochran's limits beside ISO 5725-2, study sizes beside simulated studies."""

from __future__ import annotations

import numpy as np
import pytest
import statsmodels.api as sm

from tsis.errors import InputError
from tsis.study.precision import linearity, repeatability, reproducibility, study_size


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
