"""The tables of trust: tenths, ratios to the chosen peer, and cases that share one search."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from benchmarks.matching.summary import TrustCase, trust_cases
from benchmarks.matching.trials import matching_error
from benchmarks.matching.trust import best_peers, draw_reliability, ratio_table, tenths, trust_table
from benchmarks.matching.trust_shapes import trust_trial

from tsis.matching import register

if TYPE_CHECKING:
    from pathlib import Path


def _case(method: str, error: float, confidence: float = 0.0, number: int = 0) -> TrustCase:
    return TrustCase(
        trial=f"test/oval/noise/{number}",
        method=method,
        error=error,
        unmoved_error=0.3,
        confidence=confidence,
        reliable=confidence >= 0.999,
        second=0.0,
        seconds=0.1,
        measures=(),
    )


CASES = [
    _case("tprl", 0.01, 0.9995, 0),
    _case("tprl", 0.2, 0.95, 1),
    _case("tprl", 0.01, 0.55, 2),
    *(_case("pycpd", 0.02, number=number) for number in range(3)),
    *(_case("biocpd", 0.03, number=number) for number in range(3)),
]


def test_tenths_count_own_answers_and_how_many_were_right() -> None:
    assert tenths(CASES) == [(5, 1, 0.55, 1.0), (9, 2, pytest.approx(0.97475), 0.5)]


def test_a_right_answer_that_is_not_reliable_is_withheld() -> None:
    assert "| tprl | 3 | 1 | 0 | 1 | 1 of 2 | 1 of 2 |" in trust_table(CASES)


def test_errors_are_divided_by_those_of_the_best_peer() -> None:
    assert best_peers(CASES) == {("oval", "noise"): "pycpd"}
    row = next(line for line in ratio_table(CASES, best_peers(CASES)) if line.startswith("| oval | noise |"))
    everything, at_the_prior, without = row.split(" | ")[3:]
    assert everything.startswith("3.67 [")
    assert at_the_prior.startswith("10.17 [")
    assert without.startswith("0.50 [0.50, 0.50]")


def test_the_reliability_diagram_is_a_picture(tmp_path: Path) -> None:
    draw_reliability(CASES, tmp_path / "diagram.png")
    assert (tmp_path / "diagram.png").read_bytes().startswith(b"\x89PNG")


def test_methods_share_the_search_and_answer_as_they_do_alone() -> None:
    trial = trust_trial("calibration", "lobes", "occlusion", 0, seed=5)
    own, rival = trust_cases(trial, ["tprl", "cpd"])
    for case, method in ((own, "tprl"), (rival, "cpd")):
        alone = register(trial.source, trial.target, method=method)
        assert case.error == pytest.approx(matching_error(trial, alone.untrusted.moved), abs=1e-9)
        assert case.confidence == pytest.approx(alone.confidence, abs=0.02)
    assert own.rated() == own
    assert replace(own, measures=(*own.measures[:-1], 0.0)).rated().confidence <= 0.5


def test_moves_are_repeated_until_they_gain_nothing() -> None:
    """One pass of them left this contour among outliers at an error of 0.116."""
    trial = trust_trial("calibration", "contour", "outliers", 3, seed=70011)
    assert matching_error(trial, register(trial.source, trial.target).untrusted.moved) < 0.02
