"""An analysis beside statistics and scikit-learn called by hand on the table that a study exports."""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING

import numpy as np
import pytest
from sklearn.metrics import brier_score_loss, confusion_matrix, roc_auc_score
from tests.study.made import HEADINGS, made_study, read_study, table

from tsis.errors import RecordsError
from tsis.study.agreement import intraclass_correlation
from tsis.study.analysis import analyse
from tsis.study.folder import enter_readings, open_study, read_seal, unblind
from tsis.study.plan import DeviceReading
from tsis.study.precision import reproducibility
from tsis.study.proportions import Counts
from tsis.study.readings import export_readings, import_table
from tsis.study.roc import Roc, at_sensitivity, at_specificity, held_out_counts, youden_point

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from tsis.study.analysis import StudyAnalysis
    from tsis.study.folder import Study


def by_hand(study: Study, device: str) -> tuple[list[dict[str, str]], NDArray[np.bool_]]:
    """Rows of the table, and the truth of each out of the opened seal."""
    rows = list(csv.DictReader(io.StringIO(export_readings(study, device).decode())))
    truths = read_seal(study)[0].truths
    return rows, np.array([truths[row["code"]].has_inclusion for row in rows])


def analysed(study: Study) -> StudyAnalysis:
    return analyse(unblind(study, by="Ada"))


def test_numbers_are_those_of_the_table_by_hand(tmp_path: Path) -> None:
    study = read_study(tmp_path, present=20, blank=15)
    (one,) = analysed(study).devices
    rows, present = by_hand(study, "feeler")
    scores = np.array([float(row["score"]) for row in rows])
    counts = Counts.of(scores >= 0.5, present)
    assert one.counts == counts
    assert confusion_matrix(present, scores >= 0.5).ravel().tolist() == [
        counts.true_negatives,
        counts.false_positives,
        counts.false_negatives,
        counts.true_positives,
    ]
    curve = Roc.of(scores, present)
    assert one.curve is not None
    assert one.curve.auc == curve.auc == pytest.approx(roc_auc_score(present, scores), abs=1e-12)
    assert one.auc_interval == curve.auc_interval()
    assert one.points == (
        youden_point(curve),
        at_sensitivity(curve, 0.9),
        at_specificity(curve, 0.9),
    )
    assert one.held_out == held_out_counts(scores, present, youden_point)
    assert one.reliability is not None
    assert one.reliability.brier.score == pytest.approx(brier_score_loss(present, scores), abs=1e-12)
    assert one.brier_interval is not None
    assert one.brier_interval.holds(one.reliability.brier.score)
    assert not one.few


def test_errors_of_found_inclusions_are_those_of_the_table(tmp_path: Path) -> None:
    study = read_study(tmp_path, present=20, blank=5)
    (one,) = analysed(study).devices
    truths = read_seal(study)[0].truths
    rows, present = by_hand(study, "feeler")
    found = [row for row, inside in zip(rows, present, strict=True) if inside and float(row["score"]) >= 0.5]
    assert 0 < len(found) < 20
    for errors in one.errors:
        away = np.array([float(row[errors.quantity]) - truths[row["code"]].values[errors.quantity] for row in found])
        assert errors.bias == pytest.approx(away.mean())
        assert errors.rmse == pytest.approx(np.sqrt((away**2).mean()))
        assert errors.largest == pytest.approx(np.abs(away).max())
        assert errors.covered is None
    sizes = [stratum for stratum in one.strata if stratum.quantity == "diameter_mm"]
    assert sum(each.detected.successes for each in sizes if each.detected) == len(found)
    assert sum(each.detected.trials for each in one.strata if each.detected and each.quantity == "depth_mm") == 20
    small = sum(truth.has_inclusion and truth.values["diameter_mm"] < 5 for truth in truths.values())
    assert sizes[0].detected is not None
    assert sizes[0].detected.trials == small


def test_undecided_targets_are_left_out_and_taken_as_wrong(tmp_path: Path) -> None:
    study = made_study(tmp_path / "study", present=6, blank=6)
    truths = read_seal(study)[0].truths
    inside = [code for code in study.plan.codes if truths[code].has_inclusion]
    blank = [code for code in study.plan.codes if not truths[code].has_inclusion]
    scores = dict.fromkeys(inside, "0.9") | dict.fromkeys(blank, "0.1") | {inside[0]: "", blank[0]: "", blank[1]: ""}
    rows = "\n".join(f"{code},{score},Cleo,1,,," for code, score in scores.items() if code != inside[1])
    (one,) = analysed(import_table(study, f"{HEADINGS}\n{rows}\n".encode(), "a.csv", device="feeler")).devices
    assert one.counts == Counts(true_positives=4, false_negatives=0, true_negatives=4, false_positives=0)
    assert one.counts_if_wrong == Counts(true_positives=4, false_negatives=1, true_negatives=4, false_positives=2)
    assert one.auc_if_wrong == pytest.approx(16 / 30)  # 4 of 5 above 4 of 6
    assert (len(one.results.undecided), len(one.results.unread), one.undecided_readings) == (3, 1, 3)
    assert one.few


def test_one_class_alone_is_said_and_not_invented(tmp_path: Path) -> None:
    study = read_study(tmp_path, present=4, blank=0)
    (one,) = analysed(study).devices
    assert one.curve is None
    assert one.auc_interval is None
    assert "target without an inclusion" in one.missing["curve"] or "without" in one.missing["curve"]
    assert one.counts is not None
    assert one.counts.present == 4
    assert one.few


def test_repeats_and_operators_are_compared(tmp_path: Path) -> None:
    study = made_study(tmp_path / "study", repeats=3)
    study = import_table(study, table(study, operators=("Cleo", "Dan")).encode(), "a.csv", device="feeler")
    (one,) = analysed(study).devices
    rows, _ = by_hand(study, "feeler")
    cube = np.array([float(row["score"]) for row in rows]).reshape(2, 3, 16)  # operator, repeat, target
    found = {(each.quantity, each.between): each for each in one.agreements}
    within, between = found["score", "within an operator"], found["score", "between operators"]
    assert (within.targets, within.repeats, between.operators) == (16, 3, 2)
    assert within.correlation.value == intraclass_correlation(cube[0].T, "ICC(1,1)").value
    assert within.coefficient.value == pytest.approx(2.7718 * np.sqrt(cube[0].var(axis=0, ddof=1).mean()), rel=1e-4)
    assert between.correlation.value == intraclass_correlation(cube[:, 0].T, "ICC(2,1)").value
    assert between.coefficient.value == pytest.approx(reproducibility(cube.transpose(2, 0, 1)).coefficient)
    assert found["diameter_mm", "within an operator"].targets == 8
    assert one.counts is not None
    assert one.counts.targets == 16  # the first reading of each alone
    assert one.readings == 96


def test_the_lowest_repeat_is_judged_in_whatever_order_rows_come(tmp_path: Path) -> None:
    found = []
    for name, turned in (("a", False), ("b", True)):
        study = made_study(tmp_path / name, repeats=2)
        head, *rows = table(study, operators=("Cleo", "Dan")).splitlines()
        per_operator = len(rows) // 2
        cleo, dan = rows[:per_operator], rows[per_operator:]
        rows = cleo[::-1] + dan[::-1] if turned else rows
        study = import_table(study, "\n".join([head, *rows]).encode(), "a.csv", device="feeler")
        (one,) = analysed(study).devices
        scores = {row.split(",")[0]: float(row.split(",")[1]) for row in cleo if row.split(",")[3] == "1"}
        assert {target.code: target.score for target in one.results.targets} == scores
        found.append(one)
    plain, turned_one = found
    assert plain.counts == turned_one.counts
    for was, again in zip(plain.agreements, turned_one.agreements, strict=True):
        assert again.correlation.value == pytest.approx(was.correlation.value)
        assert again.coefficient.value == pytest.approx(was.coefficient.value)


def test_one_operator_is_judged_where_rows_of_two_are_mixed(tmp_path: Path) -> None:
    study = made_study(tmp_path / "study", present=4, blank=4)
    head, *rows = table(study, operators=("Cleo", "Dan")).splitlines()
    mixed = sorted(rows[1:], key=lambda row: -float(row.split(",")[1]))  # the higher score of a target comes first
    study = import_table(study, "\n".join([head, rows[0], *mixed]).encode(), "a.csv", device="feeler")
    (one,) = analysed(study).devices
    assert {target.reading.operator for target in one.results.targets if target.reading} == {"Cleo"}


def test_operators_who_contradict_each_other_are_analysed(tmp_path: Path) -> None:
    study = made_study(tmp_path / "study", present=5, blank=5)
    truths = read_seal(study)[0].truths
    rows = [
        f"{code},{0.9 if truths[code].has_inclusion == right else 0.1},{who},1,,,"
        for who, right in (("Bob", False), ("Ada", True))
        for code in study.plan.codes
    ]
    study = import_table(study, "\n".join([HEADINGS, *rows]).encode(), "a.csv", device="feeler")
    (one,) = analysed(study).devices
    (between,) = one.agreements
    assert between.correlation.interval is None
    assert "ratings must differ more between targets" in between.correlation.remark


@pytest.mark.parametrize(("present", "method"), [(8, "bootstrap"), (31, "delong")])
def test_a_second_device_is_compared_on_the_same_targets(tmp_path: Path, present: int, method: str) -> None:
    study = read_study(tmp_path, present=present, blank=present, apart=3.0)
    study = import_table(study, table(study, seed=1, apart=0.5).encode(), "b.csv", device="camera")
    found = analysed(study)
    (comparison,) = found.comparisons
    first, present_truth = by_hand(study, "feeler")
    second, _ = by_hand(study, "camera")
    assert [row["code"] for row in first] == [row["code"] for row in second]
    areas = [roc_auc_score(present_truth, [float(row["score"]) for row in rows]) for rows in (first, second)]
    assert comparison.areas is not None
    assert comparison.areas.difference == pytest.approx(areas[0] - areas[1])
    assert comparison.areas.method == method
    both = np.array([[float(row["depth_mm"]) for row in rows if row["depth_mm"]] for rows in (first, second)])
    assert comparison.limits["depth_mm"].bias == pytest.approx((both[0] - both[1]).mean())
    assert found.devices[1].counts != found.devices[0].counts


def test_rounded_scores_are_told_apart_by_their_ranks(tmp_path: Path) -> None:
    study = made_study(tmp_path / "study")
    truths = read_seal(study)[0].truths
    present = np.array([truths[code].has_inclusion for code in study.plan.codes])
    ranks = np.random.default_rng(5).normal(60 + 20 * present, 15)
    readings = [
        DeviceReading(code=code, device="sure", operator="Cleo", repeat=1, score=1.0, rank=float(rank))
        for code, rank in zip(study.plan.codes, ranks, strict=True)
    ]
    one = analysed(enter_readings(study, readings, actor="Cleo")).devices[0]
    assert one.results.is_ranked
    assert one.curve is not None
    assert one.curve.auc == pytest.approx(roc_auc_score(present, ranks), abs=1e-12)
    assert 0.5 < one.curve.auc < 1
    assert one.held_out == held_out_counts(ranks, present, youden_point)
    assert one.reliability is not None
    assert one.reliability.brier.score == pytest.approx(0.5), "which takes the score for a probability as before"


def test_scores_that_are_no_probabilities_have_no_brier_score(tmp_path: Path) -> None:
    study = made_study(tmp_path / "study", present=3, blank=3)
    rows = "\n".join(f"{code},{place},Cleo,1,,," for place, code in enumerate(study.plan.codes))
    study = import_table(study, f"{HEADINGS}\n{rows}\n".encode(), "a.csv", device="feeler", threshold=3.0)
    (one,) = analysed(study).devices
    assert one.reliability is None
    assert "must lie in [0, 1]" in one.missing["reliability"]
    assert one.results.threshold == 3.0
    assert one.counts is not None
    assert one.counts.true_positives + one.counts.false_positives == 3


def test_the_same_study_has_the_same_answer(tmp_path: Path) -> None:
    study = unblind(read_study(tmp_path), by="Ada")
    one, other = analyse(study), analyse(open_study(study.folder))
    assert one.devices[0].brier_interval == other.devices[0].brier_interval


def test_a_blind_study_is_not_analysed(tmp_path: Path) -> None:
    with pytest.raises(RecordsError, match="must be unblinded"):
        analyse(read_study(tmp_path))
