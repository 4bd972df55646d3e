"""Curves and areas beside scikit-learn's and SciPy's, variances and paired tests beside R's pROC, chosen thresholds.

Operating points are compared with a search of all thresholds, and a chosen one with how much it flatters itself.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from benchmarks.detection_intervals import study
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import erfinv
from scipy.stats import mannwhitneyu
from sklearn.metrics import balanced_accuracy_score, confusion_matrix, roc_auc_score, roc_curve
from tests.study.references import REFERENCES

from tsis.errors import InputError
from tsis.study.proportions import Counts
from tsis.study.roc import (
    Roc,
    at_costs,
    at_sensitivity,
    at_specificity,
    auc_covariance,
    bootstrap_compare_detectors,
    compare_detectors,
    drawn_areas,
    held_out_counts,
    newcombe_interval,
    youden_point,
)

Study = tuple[np.ndarray, np.ndarray]


@st.composite
def studies(draw: st.DrawFn) -> Study:
    """Scores with many ties, and both kinds of target."""
    m, n = draw(st.integers(1, 12)), draw(st.integers(1, 12))
    scores = draw(st.lists(st.integers(-5, 5), min_size=m + n, max_size=m + n))
    order = draw(st.permutations(range(m + n)))
    return np.array(scores, dtype=float), np.array(order) < m


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


SETS = sorted(REFERENCES["roc"])


def _read(name: str) -> tuple[dict[str, Any], np.ndarray, np.ndarray]:
    result = REFERENCES["roc"][name]
    return result, np.array([result["first"], result["second"]]), np.array(result["present"]) == 1


@pytest.mark.parametrize("name", SETS)
def test_areas_and_covariances_are_those_of_proc(name: str) -> None:
    result, scores, present = _read(name)
    found = auc_covariance(scores, present)
    assert found.auc == pytest.approx(result["auc"], abs=1e-10)
    assert np.diag(found.covariance) == pytest.approx(result["variance"], abs=1e-10)
    assert found.covariance[0, 1] == found.covariance[1, 0] == pytest.approx(result["covariance"], abs=1e-10)
    assert list(Roc.of(scores[0], present).auc_interval(0.9, "delong")) == pytest.approx(
        result["interval_90"], abs=1e-10
    )


@pytest.mark.parametrize("name", SETS)
def test_paired_tests_are_those_of_proc(name: str) -> None:
    result, scores, present = _read(name)
    found = compare_detectors(scores[0], scores[1], present)
    assert found.z == pytest.approx(result["z"], abs=1e-10)
    assert found.p == pytest.approx(result["p"], abs=1e-10)
    assert found.interval is not None
    assert list(found.interval) == pytest.approx(result["difference_interval_95"], abs=1e-10)
    assert found.method == found.interval.method == "delong"


def test_placements_by_sorting_are_those_of_all_pairs() -> None:
    rng = np.random.default_rng(4)
    present = rng.permutation(np.arange(30) < 11)
    scores = rng.integers(0, 6, (3, 30)) + present
    pairs = np.sign(scores[:, present][:, :, None] - scores[:, ~present][:, None, :]) / 2 + 0.5
    found = auc_covariance(scores, present)
    assert found.auc == pytest.approx(pairs.mean(axis=(1, 2)))
    by_pairs = np.cov(pairs.mean(axis=2)) / 11 + np.cov(pairs.mean(axis=1)) / 19
    np.testing.assert_allclose(found.covariance, by_pairs, atol=1e-15)


@given(st.integers(0, 2**32), st.integers(2, 15), st.integers(2, 15))
def test_swapping_the_methods_turns_the_difference(seed: int, m: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    present = np.arange(m + n) < m
    first, second = rng.integers(0, 4, (2, m + n))
    one, two = compare_detectors(first, second, present), compare_detectors(second, first, present)
    assert one.difference == pytest.approx(-two.difference, abs=1e-15)
    assert one.standard_error == two.standard_error
    assert one.p == two.p
    assert (one.interval is None) == (one.standard_error == 0) == bool(one.remark)


@pytest.mark.parametrize("other", [lambda scores: scores, np.exp, lambda scores: 2 * scores - 7])
def test_equal_rankings_are_said_to_have_no_spread(other: Any) -> None:
    rng = np.random.default_rng(5)
    present = np.arange(40) < 17
    scores = rng.normal(size=40) + present
    for found in (
        compare_detectors(scores, other(scores), present),
        bootstrap_compare_detectors(scores, other(scores), present, rng=rng, draws=200),
    ):
        assert found.difference == found.standard_error == 0
        assert (found.z, found.p, found.interval) == (None, None, None)
        assert "does not vary" in found.remark


def test_a_faultless_method_beside_a_useless_one_has_a_difference_without_spread() -> None:
    found = compare_detectors([1, 2, 3, 4], [4, 3, 2, 1], [False, False, True, True])
    assert found.difference == 1.0
    assert found.p is None
    assert found.remark


@pytest.mark.parametrize("name", ["large", "uneven"])
def test_the_bootstrap_compares_alike(name: str) -> None:
    result, scores, present = _read(name)
    heard: list[tuple[int, int]] = []
    found = bootstrap_compare_detectors(
        scores[0], scores[1], present, rng=np.random.default_rng(6), draws=20000, progress=lambda *at: heard.append(at)
    )
    assert found.z == pytest.approx(result["z"], rel=0.05)
    assert found.interval is not None
    assert list(found.interval) == pytest.approx(result["difference_interval_95"], abs=0.02)
    assert heard[-1] == (20000, 20000)
    assert len(heard) > 1


def test_delongs_standard_error_is_that_of_ten_thousand_bootstraps() -> None:
    # With 300 targets of each kind what both neglect is below a percent; 10,000 draws leave 0.7 %.
    rng = np.random.default_rng(7)
    present = np.arange(600) < 300
    scores = rng.normal(size=600) + 1.2 * present
    drawn = drawn_areas(scores[None], present, rng=rng, draws=10_000)
    variance = auc_covariance(scores[None], present).covariance[0, 0]
    assert drawn.std() == pytest.approx(np.sqrt(variance), rel=0.02)


def test_draws_are_those_of_targets_picked_one_by_one() -> None:
    rng = np.random.default_rng(8)
    present = np.arange(12) < 5
    scores = rng.integers(0, 5, (2, 12)).astype(float)
    drawn = drawn_areas(scores, present, rng=rng, draws=20_000)
    plain = np.empty((5_000, 2))
    for areas in plain:
        picked = np.concatenate([rng.integers(0, 5, 5), rng.integers(5, 12, 7)])
        areas[:] = [Roc.of(row[picked], present).auc for row in scores]
    assert drawn.mean(axis=0) == pytest.approx(plain.mean(axis=0), abs=0.015)
    np.testing.assert_allclose(np.cov(drawn.T), np.cov(plain.T), atol=0.0025)


@pytest.mark.parametrize(
    ("first", "second", "present", "said"),
    [
        ([1, 2, 3], [1, 2, 3], [True, False, False], "present must be True for at least 2 targets for a paired test"),
        ([1, 2, 3, 4], [1, 2, 3], [True, True, False, False], "second and present must be equally long"),
        ([1, 2, 3], [1, 2, 3, 4], [True, True, False, False], "first and present must be equally long"),
        ([1, 2, np.nan, 4], [1, 2, 3, 4], [True, True, False, False], "first must be finite"),
        ([1, 2, 3, 4], [1, 2, 3, 4], [1, 1, 0, 0], "present must hold True and False"),
    ],
)
def test_bad_pairs_are_told(first: list[float], second: list[float], present: list[bool], said: str) -> None:
    with pytest.raises(InputError, match=said):
        compare_detectors(first, second, present)


def test_a_table_of_the_wrong_shape_is_told() -> None:
    with pytest.raises(InputError, match=r"scores must have one column a target, 4 in all; got shape \(2, 3\)"):
        auc_covariance([[1, 2, 3], [1, 2, 3]], [True, True, False, False])


def _all_decisions(study: Study) -> list[Counts]:
    """By each threshold midway between scores, and beyond both ends."""
    scores, present = study
    levels = np.unique(scores)
    thresholds = [-math.inf, *(levels[1:] + levels[:-1]) / 2, math.inf]
    return [Counts.of(scores >= threshold, present) for threshold in thresholds]


@given(studies(), st.floats(0, 1), st.floats(0.01, 0.99), st.floats(0.1, 10))
def test_points_are_the_best_of_all(study: Study, wanted: float, prevalence: float, missed: float) -> None:
    curve, options = Roc.of(*study), _all_decisions(study)
    best = max(one.youden.value for one in options)
    assert youden_point(curve).counts.youden.value == pytest.approx(best)
    point = at_sensitivity(curve, wanted)
    enough = [one.specificity.value for one in options if one.sensitivity.value >= wanted - 1e-9]
    assert point.counts.specificity.value == max(enough)
    point = at_specificity(curve, wanted)
    enough = [one.sensitivity.value for one in options if one.specificity.value >= wanted - 1e-9]
    assert point.counts.sensitivity.value == max(enough)

    def cost(one: Counts) -> float:
        return prevalence * missed * (1 - one.sensitivity.value) + (1 - prevalence) * (1 - one.specificity.value)

    point = at_costs(curve, prevalence=prevalence, missed=missed, false_alarm=1.0)
    assert cost(point.counts) == pytest.approx(min(map(cost, options)), rel=1e-8, abs=1e-12)


@given(studies(), st.floats(0, 1))
def test_a_point_decides_as_it_counts(study: Study, wanted: float) -> None:
    scores, present = study
    for point in (
        youden_point(Roc.of(*study)),
        at_sensitivity(Roc.of(*study), wanted),
        at_specificity(Roc.of(*study), wanted),
    ):
        assert Counts.of(point.decide(scores), present) == point.counts


def test_neighbouring_numbers_are_parted() -> None:
    low = 1.0
    high = math.nextafter(low, 2)
    point = youden_point(Roc.of([low, high], [False, True]))
    assert point.decide([low, high]).tolist() == [False, True]
    huge = youden_point(Roc.of([1.6e308, 1.7e308], [False, True]))
    assert huge.threshold == pytest.approx(1.65e308)


def test_costs_move_the_threshold_from_end_to_end() -> None:
    rng = np.random.default_rng(1)
    present = np.arange(100) < 40
    curve = Roc.of(rng.normal(size=100) + present, present)
    assert at_costs(curve, prevalence=0.4, missed=1, false_alarm=0).counts.sensitivity.value == 1
    assert at_costs(curve, prevalence=0.4, missed=0, false_alarm=1).threshold == math.inf
    equal = at_costs(curve, prevalence=0.5, missed=1, false_alarm=1)
    assert equal.counts.youden.value == pytest.approx(youden_point(curve).counts.youden.value)


def test_a_chosen_point_flatters_itself_and_held_out_counts_do_not() -> None:
    rng = np.random.default_rng(2)
    present = np.arange(30) < 15
    chosen, held = [], []
    for _ in range(60):
        scores = rng.normal(size=30)  # which know nothing
        chosen.append(youden_point(Roc.of(scores, present)).counts.accuracy.value)
        held.append(held_out_counts(scores, present, youden_point, folds=5, rng=rng).accuracy.value)
    assert np.mean(chosen) > 0.57
    assert np.mean(held) == pytest.approx(0.5, abs=0.05)


def test_held_out_counts_are_those_of_a_plain_loop() -> None:
    rng = np.random.default_rng(3)
    present = np.arange(25) < 10
    scores = rng.normal(size=25) + 2 * present
    decided = []
    for index in range(25):
        others, truth = np.delete(scores, index), np.delete(present, index)
        levels = np.unique(others)
        middles = [math.inf, *((levels[1:] + levels[:-1]) / 2)[::-1], -math.inf]
        best = max(middles, key=lambda at: balanced_accuracy_score(truth, others >= at))
        decided.append(bool(scores[index] >= best))
    assert held_out_counts(scores, present, youden_point) == Counts.of(decided, present)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda curve: at_sensitivity(curve, 1.2), "requested must lie in"),
        (lambda curve: at_specificity(curve, math.nan), "requested must lie in"),
        (lambda curve: at_costs(curve, prevalence=2, missed=1, false_alarm=1), "prevalence must lie in"),
        (lambda curve: at_costs(curve, prevalence=0.5, missed=-1, false_alarm=1), "missed must lie in"),
        (lambda curve: at_costs(curve, prevalence=0.5, missed=0, false_alarm=0), "missed or false_alarm must cost"),
        (lambda curve: youden_point(curve).decide([math.nan]), "scores must be finite"),
        (lambda curve: held_out_counts([1, 2, 3], [True, False, False], youden_point), "present must be True for at"),
        (
            lambda curve: held_out_counts(curve.scores, curve.present, youden_point, folds=3, rng=None),
            r"folds must lie in \[2, 2\]",
        ),
        (
            lambda curve: held_out_counts(curve.scores, curve.present, youden_point, folds=2),
            "rng must be a numpy.random.Generator",
        ),
    ],
)
def test_bad_wishes_are_told(call: Any, said: str) -> None:
    with pytest.raises(InputError, match=said):
        call(Roc.of([1, 3, 2, 4], [False, False, True, True]))
