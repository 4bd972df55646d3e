from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from benchmarks.matching.runs import MatchOutcome, TrialRow, run_trials
from benchmarks.matching.trials import generated_trials, matching_error

if TYPE_CHECKING:
    from pathlib import Path

    from benchmarks.matching.distort import Trial
    from numpy.typing import NDArray


def still(source: NDArray[np.float64], target: NDArray[np.float64], *, rng: np.random.Generator) -> MatchOutcome:
    del target, rng
    return MatchOutcome(transformed=source, reliable=False)


def shifted(source: NDArray[np.float64], target: NDArray[np.float64], *, rng: np.random.Generator) -> MatchOutcome:
    return MatchOutcome(
        transformed=source + target.mean(axis=0) - source.mean(axis=0) + rng.normal(0, 0.01), reliable=True
    )


def broken(source: NDArray[np.float64], target: NDArray[np.float64], *, rng: np.random.Generator) -> MatchOutcome:
    raise ZeroDivisionError("no,\nnot today")


def endless(source: NDArray[np.float64], target: NDArray[np.float64], *, rng: np.random.Generator) -> MatchOutcome:
    return MatchOutcome(transformed=np.full_like(source, np.inf), reliable=None)


METHODS = {"still": still, "shifted": shifted}


def trials(count: int = 4) -> list[Trial]:
    return list(generated_trials(shape="curve", family="deformation", level=3, count=count, points=20))


def without_time(rows: list[TrialRow]) -> list[tuple[str, str, float, str]]:
    return [(row.trial, row.method, row.error, row.reliable) for row in rows]


def test_rows_say_what_each_method_made_of_each_trial() -> None:
    given = trials()
    rows = run_trials(given, METHODS)
    assert [(row.trial, row.method) for row in rows] == [
        (f"curve/deformation/3/{number}", name) for number in range(4) for name in METHODS
    ]
    assert {(row.group, row.level) for row in rows} == {("curve/deformation", "3")}
    assert [row.error for row in rows[::2]] == [matching_error(trial, trial.source) for trial in given]
    assert {row.reliable for row in rows[::2]} == {"no"}
    assert {row.reliable for row in rows[1::2]} == {"yes"}
    assert all(row.seconds >= 0 for row in rows)


def test_a_method_that_breaks_moved_nothing_and_the_others_go_on() -> None:
    given = trials(2)
    rows = run_trials(given, {"broken": broken, "endless": endless, "still": still})
    assert [row.error for row in rows] == [matching_error(trial, trial.source) for trial in given for _ in range(3)]
    assert rows[0].refused == "ZeroDivisionError: no, not today"
    assert "must be finite" in rows[1].refused
    assert rows[2].refused == ""


def test_chance_belongs_to_the_seed_the_trial_and_the_method() -> None:
    alone = run_trials(trials(3)[2:], {"shifted": shifted}, seed=1)
    among = run_trials(trials(4), METHODS, seed=1)
    other = run_trials(trials(4), METHODS, seed=2)
    assert without_time(alone)[0] in without_time(among)
    assert without_time(among) != without_time(other)


def test_a_file_is_resumed_and_ends_as_though_never_interrupted(tmp_path: Path) -> None:
    expected, parts = run_trials(trials(), METHODS), tmp_path / "new" / "parts.jsonl"
    first = run_trials(trials(2), {"still": still, "broken": broken}, file=parts)
    with parts.open("a") as file:
        file.write('\n{"key": "0 curve/deformation/3/2 still", "err')  # a run that was killed in the middle of a line
    rows = run_trials(trials(), METHODS, file=parts)
    assert without_time(rows) == without_time(expected)
    assert rows[0] == first[0]  # not run again
    assert run_trials(trials(), METHODS, file=parts) == rows
    assert run_trials(trials(2), {"still": still, "broken": broken}, file=parts) == first
