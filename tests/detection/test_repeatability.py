"""Variance components beside statsmodels' and SciPy's, and how often the intervals hold."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import f_oneway
from statsmodels.formula.api import ols
from statsmodels.stats.anova import anova_lm

from tsis.errors import InputError
from tsis.study.precision import repeatability, reproducibility


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
