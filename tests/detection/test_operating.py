"""Operating points beside a search of all thresholds, and how much a chosen one flatters itself."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn.metrics import balanced_accuracy_score
from tests.detection.drawn_studies import Study, studies

from tsis.errors import InputError
from tsis.study.proportions import Counts
from tsis.study.roc import Roc, at_costs, at_sensitivity, at_specificity, held_out_counts, youden_point


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
