from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from tsis.present.figures import (
    agreement_limits,
    detected_by_size_and_depth,
    read_over_true,
    reliability_diagram,
    roc_curve,
    scores_by_truth,
)
from tsis.study.agreement import bland_altman
from tsis.study.probabilities import reliability_curve
from tsis.study.proportions import Counts
from tsis.study.roc import Roc

SCORES, TRUTH = [0.1, 0.4, 0.35, 0.8, 0.7], [False, False, True, True, True]


def test_the_curve_encloses_its_area_and_the_point_is_that_of_the_counts() -> None:
    curve = Roc.of(SCORES, TRUTH)
    counts = Counts.of(np.array(SCORES) >= 0.5, TRUTH)
    ax = roc_curve(curve, Figure().subplots(), counts=counts, label="a")
    line = next(each for each in ax.lines if each.get_drawstyle() == "steps-post")
    x, y = np.asarray(line.get_xdata(), dtype=float), np.asarray(line.get_ydata(), dtype=float)
    assert float((np.diff(x) * y[:-1]).sum()) == pytest.approx(curve.auc)
    point = next(each for each in ax.lines if each.get_marker() == "o")
    assert (point.get_xdata()[0], point.get_ydata()[0]) == (0.0, pytest.approx(2 / 3))  # type: ignore[index]


def test_every_score_is_drawn_on_its_side() -> None:
    ax = scores_by_truth(SCORES, TRUTH, Figure().subplots(), threshold=0.5)
    blank, inside = (np.asarray(each.get_ydata(), dtype=float) for each in ax.lines[:2])
    assert sorted(blank) == [0.1, 0.4]
    assert sorted(inside) == [0.35, 0.7, 0.8]


def test_shares_are_drawn_over_probabilities() -> None:
    curve = reliability_curve(SCORES, TRUTH, bins=2)
    ax = reliability_diagram(curve, Figure().subplots())
    assert np.asarray(ax.lines[1].get_ydata()).tolist() == [one.observed.value for one in curve.bins]
    assert sum(int(text.get_text()) for text in ax.texts) == 5


def test_found_missed_and_undecided_are_told_apart() -> None:
    ax = detected_by_size_and_depth([3.0, 5.0, 7.0], [4.0, 6.0, 8.0], [True, False, None], Figure().subplots())
    assert [each.get_label() for each in ax.lines] == ["found", "missed", "undecided"]
    low, high = ax.get_ylim()
    assert low > high  # deep ones below
    assert not detected_by_size_and_depth([], [], [], Figure().subplots()).lines


def test_readings_stand_over_the_truth_and_limits_beside_the_bias() -> None:
    ax = read_over_true(
        [1.0, 2.0], [1.5, 2.5], Figure().subplots(), label="depth / mm", errors=[[0.1, 0.1], [0.2, 0.2]]
    )
    assert ax.get_xlabel() == "true depth / mm"
    found = bland_altman([8.1, 10.2, 12.4, 6.0], [8.0, 9.9, 12.5, 5.7])
    ax = agreement_limits(found, Figure().subplots(), label="diameter / mm")
    heights = {float(np.asarray(each.get_ydata(), dtype=float)[0]) for each in ax.lines[1:]}
    assert heights == {0.0, found.bias, *found.limits()}
