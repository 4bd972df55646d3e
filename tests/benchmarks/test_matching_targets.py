from __future__ import annotations

import numpy as np
import pytest
from benchmarks.matching.__main__ import (
    SPEED_POINTS,
    distorted_goals,
    exponent,
    growth,
    hotel_goals,
    speed_trials,
    texture_trials,
    time_goals,
)
from benchmarks.matching.runs import TrialRow
from benchmarks.matching.summary import summarise, summarise_pooled

from tsis.matching.methods import UNMATCHED


def rows_of(name: str, method: str, errors: list[float], *, seconds: float = 0.1) -> list[TrialRow]:
    return [
        TrialRow(trial=f"{name}/{number}", method=method, seed=0, error=error, seconds=seconds, reliable="", refused="")
        for number, error in enumerate(errors)
    ]


def test_the_exponent_of_a_power_law() -> None:
    points = np.array(SPEED_POINTS, dtype=float)
    assert exponent(points.tolist(), (3e-9 * points**2.3).tolist()) == pytest.approx(2.3)


def test_textures_are_of_the_sizes_that_they_say() -> None:
    (trial,) = texture_trials(1, sizes=[3000])
    assert trial.source.shape == (1000, 2)
    assert len(trial.target) == 3000
    assert (trial.truth != UNMATCHED).all()
    assert [len(trial.source) for trial in speed_trials(1)] == list(SPEED_POINTS)


def test_ratios_are_held_against_their_limits() -> None:
    rows = [
        *rows_of("fish/deformation/1", "tprl", [0.01, 0.01]),
        *rows_of("fish/deformation/1", "cpd", [0.04, 0.04]),
        *rows_of("fish/rotation/1", "tprl", [0.01, 0.01]),
        *rows_of("fish/rotation/1", "cpd", [0.04, 0.04]),
    ]
    deformation, rotation = distorted_goals(summarise_pooled(rows, rivals=("cpd",)))
    assert (deformation.goal, deformation.met) == ("<= 0.500", True)
    assert (deformation.shown, deformation.peer) == ("0.250", "[0.250, 0.250]")
    assert (rotation.goal, rotation.met) == ("<= 0.050", False)


def test_the_hotel_counts_each_separation_once() -> None:
    rows = [
        *rows_of("hotel/hidden 0/10", "tprl", [0.5] * 9),
        *rows_of("hotel/hidden 0/100", "tprl", [2.5]),
        *rows_of("hotel/hidden 0.3/10", "tprl", [3.0]),
        *rows_of("hotel/hidden 0.3/10", "cpd", [5.0]),
        *rows_of("hotel/hidden 0.3/10", "pycpd", [4.0]),
    ]
    clear, hidden = hotel_goals(summarise(rows, rivals=("cpd",)))
    assert (clear.shown, clear.met) == ("1.500", False)
    assert (hidden.shown, hidden.peer, hidden.met) == ("3.000", "best CPD 4.000", True)
    assert list(hotel_goals([])) == []


def test_times_and_their_growth() -> None:
    rows = rows_of("texture/outliers/4000", "tprl", [0.0], seconds=5.0)
    for size in SPEED_POINTS:
        rows += rows_of(f"speed/points/{size}", "tprl", [0.0], seconds=size**2 / 1e6)
    small, large = time_goals(rows)
    assert (small.shown, small.met) == ("0.011", True)
    assert (large.name, large.shown, large.met) == ("1000 x 4000 points, s", "5.000", False)
    ((method, *times, slope),) = growth(rows)
    assert (method, times[-1], slope) == ("tprl", "4,000 ms", "2.00")
