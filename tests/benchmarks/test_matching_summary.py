from __future__ import annotations

import numpy as np
import pytest
from benchmarks.matching.runs import TrialRow
from benchmarks.matching.summary import ratio_of_means, summarise, summarise_pooled

from tsis.errors import InputError


def rows_of(group: str, level: int, method: str, errors: list[float], *, reliable: str = "") -> list[TrialRow]:
    return [
        TrialRow(
            trial=f"{group}/{level}/{number}",
            method=method,
            seed=0,
            error=error,
            seconds=0.1 * (number + 1),
            reliable=reliable,
            refused="it broke" if error == 0.9 else "",
        )
        for number, error in enumerate(errors)
    ]


ROWS = [
    *rows_of("fish/noise", 1, "tprl", [0.01, 0.02, 0.9], reliable="yes"),
    *rows_of("fish/noise", 1, "cpd", [0.02, 0.04, 0.06]),
    *rows_of("fish/noise", 1, "pycpd", [0.03, 0.05, 0.07]),
    *rows_of("fish/noise", 2, "tprl", [0.05, 0.05, 0.05], reliable="yes"),
    *rows_of("fish/noise", 2, "cpd", [0.2, 0.3, 0.1]),
    *rows_of("fish/noise", 2, "pycpd", [0.1, 0.1, 0.1]),
]


def test_a_summary_by_hand() -> None:
    found = {(each.level, each.method): each for each in summarise(ROWS, rivals=("cpd", "pycpd"))}
    assert len(found) == 6
    tprl = found["1", "tprl"]
    assert (tprl.group, tprl.trials, tprl.rival) == ("fish/noise", 3, "cpd")
    assert tprl.median == 0.02
    assert tprl.mean == pytest.approx(0.31)
    assert tprl.failures == pytest.approx(1 / 3)
    assert tprl.unannounced == pytest.approx(1 / 3)
    assert tprl.withheld == 0.0
    assert tprl.refused == pytest.approx(1 / 3)
    assert tprl.seconds == pytest.approx(0.2)
    assert tprl.ratio is not None
    assert tprl.ratio.value == pytest.approx(0.31 / 0.04)
    # Errors of every draw lie between three of the best trial and three of the worst.
    assert 0.01 / 0.02 <= tprl.ratio.low < tprl.ratio.value < tprl.ratio.high <= 0.9 / 0.06
    assert found["2", "tprl"].rival == "pycpd"  # another level, another best rival
    assert found["2", "cpd"].failures == pytest.approx(2 / 3)  # 0.1 itself is no failure
    assert found["1", "cpd"].unannounced is found["1", "cpd"].withheld is None
    best = found["1", "cpd"].ratio
    assert best is not None
    assert (best.value, best.low, best.high) == (1.0, 1.0, 1.0)


def test_pooled_levels_meet_the_best_rival_of_each() -> None:
    tprl, cpd, pycpd = summarise_pooled(ROWS, rivals=("cpd", "pycpd"))
    assert (tprl.group, tprl.level, tprl.trials) == ("noise", "", 6)
    assert tprl.rival == "cpd, pycpd"
    against = np.mean([0.02, 0.04, 0.06, 0.1, 0.1, 0.1])
    for summary, errors in ((tprl, [0.01, 0.02, 0.9, 0.05, 0.05, 0.05]), (cpd, [0.02, 0.04, 0.06, 0.2, 0.3, 0.1])):
        assert summary.ratio is not None
        assert summary.ratio.value == pytest.approx(np.mean(errors) / against)
    assert pycpd.ratio is not None
    assert pycpd.ratio.value > 1


def test_answers_that_a_method_does_not_trust_are_counted() -> None:
    rows = rows_of("fish/noise", 1, "tprl", [0.01, 0.2], reliable="no")
    rows += rows_of("fish/noise", 1, "cpd", [0.01, 0.2], reliable="yes")
    withheld, result = summarise(rows, rivals=("cpd",))
    assert (withheld.failures, withheld.withheld, withheld.unannounced) == (0.5, 1.0, 0.0)
    assert (result.failures, result.withheld, result.unannounced) == (0.5, 0.0, 0.5)


def test_without_a_rival_there_is_no_ratio() -> None:
    (summary,) = summarise(rows_of("fish/noise", 1, "tprl", [0.1, 0.2]), rivals=("cpd",))
    assert summary.ratio is None
    assert summary.rival == ""


def test_the_interval_of_a_ratio_covers_it_about_as_often_as_it_says() -> None:
    rng = np.random.default_rng(5)
    covered = 0
    for _ in range(200):
        errors, others = rng.gamma(2.0, 0.01, 70), rng.gamma(2.0, 0.02, 70)
        ratio = ratio_of_means(errors, others, rng=rng, draws=500)
        assert ratio is not None
        covered += ratio.low <= 0.5 <= ratio.high
    assert 180 <= covered <= 199


def test_a_rival_without_error_leaves_no_ratio() -> None:
    assert ratio_of_means(np.ones(3), np.zeros(3), rng=np.random.default_rng(0)) is None
    assert ratio_of_means(np.ones(3), np.array([0.0, 0.0, 1.0]), rng=np.random.default_rng(0)) is None


def test_a_limit_that_is_none_is_refused() -> None:
    with pytest.raises(InputError, match="failure must lie in"):
        summarise(ROWS, rivals=(), failure=0.0)
