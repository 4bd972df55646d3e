"""Counted decisions beside scikit-learn's, and what is said where a class is missing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn.metrics import balanced_accuracy_score, class_likelihood_ratios, confusion_matrix, precision_score

from tsis.errors import InputError
from tsis.study.proportions import Counts

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
