"""Curves and areas beside scikit-learn's and SciPy's, and properties that any such curve has."""

from __future__ import annotations

import math

import numpy as np
import pytest
from benchmarks.detection_intervals import study
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import erfinv
from scipy.stats import mannwhitneyu
from sklearn.metrics import confusion_matrix, roc_auc_score, roc_curve
from tests.detection.drawn_studies import Study, studies

from tsis.errors import InputError
from tsis.study.roc import Roc, newcombe_interval


@given(studies())
def test_curves_and_areas_are_those_of_scikit_learn(study: Study) -> None:
    scores, present = study
    curve = Roc.of(scores, present)
    false, true, thresholds = roc_curve(present, scores, drop_intermediate=False)
    np.testing.assert_allclose(curve.false_positive_rate, false, atol=1e-12)
    np.testing.assert_allclose(curve.true_positive_rate, true, atol=1e-12)
    np.testing.assert_array_equal(curve.thresholds, thresholds)
    assert curve.auc == pytest.approx(roc_auc_score(present, scores), abs=1e-12)
    counted = mannwhitneyu(scores[present], scores[~present]).statistic
    assert curve.auc == pytest.approx(counted / (curve.targets * curve.blanks), abs=1e-12)


@given(studies())
def test_counts_at_each_threshold(study: Study) -> None:
    scores, present = study
    curve = Roc.of(scores, present)
    for index, threshold in enumerate(curve.thresholds):
        counts = curve.counts(index)
        table = confusion_matrix(present, scores >= threshold, labels=[False, True])
        assert [counts.true_negatives, counts.false_positives] == list(table[0])
        assert [counts.false_negatives, counts.true_positives] == list(table[1])
        assert counts.sensitivity.value == curve.true_positive_rate[index]


@given(studies())
def test_rising_transforms_keep_the_curve_and_falling_ones_turn_it(study: Study) -> None:
    scores, present = study
    curve = Roc.of(scores, present)
    for same in (np.exp(scores), 3 * scores + 1, scores**3):
        assert Roc.of(same, present).auc == curve.auc
        assert Roc.of(same, present).auc_interval() == curve.auc_interval()
    turned = Roc.of(-scores, present)
    assert turned.auc == pytest.approx(1 - curve.auc, abs=1e-12)
    low, high = curve.auc_interval()
    assert list(turned.auc_interval()) == pytest.approx([1 - high, 1 - low], abs=1e-9)
    assert Roc.of(scores, ~present).auc == pytest.approx(1 - curve.auc, abs=1e-12)


@given(st.integers(1, 200), st.integers(1, 200), st.floats(0, 1), st.floats(0.5, 0.999))
def test_newcombes_ends_solve_his_equation(m: int, n: int, auc: float, level: float) -> None:
    low, high = newcombe_interval(auc, m, n, level)
    assert 0 <= low <= auc <= high <= 1
    z = math.sqrt(2) * float(erfinv(level))
    for end in (low, high):
        q1, q2 = end / (2 - end), 2 * end**2 / (1 + end)  # Hanley and McNeil's, here for exponential scores
        pairs = (m + n) / 2 - 1
        variance = (end * (1 - end) + pairs * (q1 - end**2) + pairs * (q2 - end**2)) / (m * n)
        assert (end - auc) ** 2 == pytest.approx(z**2 * max(variance, 0.0), abs=1e-9)


@pytest.mark.parametrize(("m", "n"), [(1, 1), (3, 4), (8, 8), (200, 5)])
def test_faultless_and_worst_curves_have_intervals_of_some_width(m: int, n: int) -> None:
    top = newcombe_interval(1.0, m, n)
    assert top.high == 1.0
    assert 0 < top.low < 1
    assert list(newcombe_interval(0.0, m, n)) == pytest.approx([0.0, 1 - top.low], abs=1e-12)


def test_the_printed_area() -> None:
    printed = newcombe_interval(0.735, 8, 8)
    assert printed.holds(0.5)
    assert list(printed) == pytest.approx([0.445, 0.899], abs=5e-4)
    # The decisions themselves, as scores, give the area that the lines through the printed point enclose.
    present = np.arange(16) < 8
    found = np.isin(np.arange(16), [0, 1, 2, 3, 4, 5, 8])
    assert Roc.of(found, present).auc == 0.8125


def test_the_method_is_chosen_by_the_number_of_targets_and_said() -> None:
    rng = np.random.default_rng(1)
    present = np.arange(60) < 30
    scores = rng.normal(size=60) + present
    assert Roc.of(scores, present).auc_interval().method == "delong"
    assert Roc.of(scores[1:], present[1:]).auc_interval().method == "newcombe"
    assert Roc.of(present, present).auc_interval().method == "newcombe"  # an area of 1
    near = scores + 3 * present
    assert 0.95 < Roc.of(near, present).auc < 1
    assert Roc.of(near, present).auc_interval().method == "newcombe"
    assert Roc.of(scores, present).auc_interval(method="bootstrap", rng=rng).method == "bootstrap"


@pytest.mark.parametrize(("size", "area"), [(3, 0.9), (8, 0.75), (50, 0.98)])
def test_the_default_holds_where_delongs_does_not(size: int, area: float) -> None:
    found = study(size, area, 300, rng=np.random.default_rng(3), draws=100)
    assert found["default"][0] > 0.92
    assert found["delong"][0] < 0.92


def test_methods_agree_where_targets_are_many() -> None:
    rng = np.random.default_rng(2)
    present = np.arange(800) < 400
    curve = Roc.of(rng.normal(size=800) + present, present)
    delong = list(curve.auc_interval(method="delong"))
    assert list(curve.auc_interval(method="newcombe")) == pytest.approx(delong, abs=0.01)
    assert list(curve.auc_interval(method="bootstrap", rng=rng)) == pytest.approx(delong, abs=0.01)


GOOD, TRUTH = [1.0, 2.0, 3.0, 4.0], [False, False, True, True]


@pytest.mark.parametrize(
    ("scores", "present", "said"),
    [
        (
            GOOD,
            [True] * 4,
            "present must be False for at least 1 target for a curve; got 0 of 4: score at least 1 target",
        ),
        (GOOD, [False] * 4, "present must be True for at least 1 target"),
        ([1, math.nan, 3, 4], TRUTH, "scores must be finite; got 1 NaN or infinite"),
        ([1, math.inf, 3, 4], TRUTH, "scores must be finite"),
        (GOOD[:3], TRUTH, "scores and present must be equally long, one value a target; got 3 and 4"),
        (GOOD, [0, 0, 1, 1], "present must hold True and False alone"),
        ([], [], "scores must not be empty"),
        ([GOOD], TRUTH, "scores must have 1 axes"),
        (["a", "b", "c", "d"], TRUTH, "scores must be an array of numbers"),
    ],
)
def test_bad_studies_are_told(scores: object, present: object, said: str) -> None:
    with pytest.raises(InputError, match=said):
        Roc.of(scores, present)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("scores", "options", "said"),
    [
        (GOOD, {"method": "delong"}, "method must not be delong where its variance is 0, .* area under the curve of 1"),
        (
            GOOD,
            {"method": "bootstrap", "rng": np.random.default_rng(0)},
            "method must not be bootstrap where every draw",
        ),
        (GOOD, {"method": "bootstrap"}, "rng must be given for the bootstrap; got None"),
        ([1, 3, 2, 4], {"method": "bootstrap", "rng": 3}, "rng must be a numpy.random.Generator; got 3"),
        ([1, 3, 2, 4], {"method": "bootstrap", "rng": np.random.default_rng(0), "draws": 2}, "draws must lie in"),
        (GOOD, {"method": "wald"}, "method must be one of delong, newcombe, bootstrap; got 'wald'"),
        (GOOD, {"level": 95}, "level must lie in"),
    ],
)
def test_intervals_that_do_not_exist_are_told(scores: list[float], options: dict[str, object], said: str) -> None:
    curve = Roc.of(scores, TRUTH)
    with pytest.raises(InputError, match=said):
        curve.auc_interval(**options)  # type: ignore[arg-type]


def test_one_target_of_each_kind() -> None:
    curve = Roc.of([1.0, 1.0], [True, False])
    assert curve.auc == 0.5
    low, high = curve.auc_interval()
    assert low < 0.2 < 0.8 < high
    with pytest.raises(InputError, match="present must be True for at least 2 targets for a variance; got 1 of 2"):
        curve.auc_interval(method="delong")


def test_curves_are_not_written_to() -> None:
    curve = Roc.of(GOOD, TRUTH)
    with pytest.raises(ValueError, match="read-only"):
        curve.thresholds[0] = 3.0
    with pytest.raises(InputError, match="index must lie in"):
        curve.counts(5)
