from __future__ import annotations

import numpy as np
import pytest
from benchmarks.matching.figures import curves_over_levels
from benchmarks.matching.summary import TrialSummary
from matplotlib.figure import Figure


def summary(method: str, level: str, *, median: float, mean: float) -> TrialSummary:
    return TrialSummary(
        group="fish/noise",
        level=level,
        method=method,
        trials=10,
        median=median,
        mean=mean,
        failures=0.25,
        unannounced=None,
        withheld=None,
        refused=0.0,
        seconds=0.01,
        ratio=None,
        rival="",
    )


SUMMARIES = [
    summary(method, level, median=0.01 * int(level), mean=0.02 * int(level))
    for method in ("tprl", "cpd")
    for level in ("1", "2", "3")
]


def test_the_median_is_a_line_and_the_mean_a_mark_of_its_own() -> None:
    ax = Figure().subplots()
    positions = {"1": 0.0, "2": 0.1, "3": 0.4}
    same = curves_over_levels(SUMMARIES, ax, quantity="error", positions=positions, level_label="noise", unit="px")
    assert same is ax
    medians, means, *others = ax.lines
    assert len(others) == 2
    np.testing.assert_allclose(np.asarray(medians.get_xdata()), [0.0, 0.1, 0.4])
    np.testing.assert_allclose(np.asarray(medians.get_ydata()), [0.01, 0.02, 0.03])
    np.testing.assert_allclose(np.asarray(means.get_ydata()), [0.02, 0.04, 0.06])
    assert means.get_linestyle() == "None"
    assert [line.get_label() for line in ax.lines if not str(line.get_label()).startswith("_")] == ["tprl", "cpd"]
    assert ax.get_ylabel().endswith("/ px")
    assert ax.get_yscale() == "log"


def test_failures_are_shares_of_one() -> None:
    ax = Figure().subplots()
    positions = dict.fromkeys("123", 0.0)
    curves_over_levels(SUMMARIES, ax, quantity="failures", positions=positions, level_label="noise")
    assert ax.get_ylim() == pytest.approx((-0.02, 1.02))
    assert ax.get_ylabel() == "share of failures"
    seconds = curves_over_levels(
        SUMMARIES, Figure().subplots(), quantity="seconds", positions=positions, level_label="noise"
    )
    assert seconds.get_ylabel() == "median time / s"
