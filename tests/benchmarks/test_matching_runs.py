from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from benchmarks.matching.runs import TRIAL_ROW_HEAD, MatchOutcome, TrialRow, read_trial_rows, run_trials
from benchmarks.matching.trials import generated_trials, matching_error

from tsis.errors import FileInputError, InputError

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
    whole, parts = tmp_path / "whole.csv", tmp_path / "new" / "parts.csv"
    expected = without_time(run_trials(trials(), METHODS, file=whole))
    run_trials(trials(2), {"still": still}, file=parts)
    kept = read_trial_rows(parts)
    with parts.open("a") as file:
        file.write("curve/deformation/3/2,still,0,0.1")  # a run that was killed in the middle of a line
    seen: list[tuple[int, int]] = []
    rows = run_trials(trials(), METHODS, file=parts, resume=True, progress=lambda *done: seen.append(done))
    assert without_time(rows) == expected
    assert rows[0] == kept[0]  # not run again
    assert seen == [(1, 4), (2, 4), (3, 4), (4, 4)]
    assert sorted(without_time(read_trial_rows(parts))) == sorted(expected)
    again = run_trials(trials(), METHODS, file=parts, resume=True, progress=lambda *done: pytest.fail(str(done)))
    assert again == rows


def test_reasons_with_commas_come_back_from_the_file(tmp_path: Path) -> None:
    rows = run_trials(trials(1), {"broken": broken}, file=tmp_path / "rows.csv")
    assert read_trial_rows(tmp_path / "rows.csv") == rows


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("something else\n", "first line is another"),
        ("", "must hold data"),
        ("\n", "first line is another"),
        (",".join(TRIAL_ROW_HEAD) + "\n" + "x" * 200_000 + "\n", "field larger than field limit"),
        (",".join(TRIAL_ROW_HEAD) + "\na/b/1/2,still,0,abc,1,,\n", "could not convert"),
        (",".join(TRIAL_ROW_HEAD) + "\na/b/1/2,still,0,nan,1,,\n", "one row a trial"),
        (",".join(TRIAL_ROW_HEAD) + "\na/b/1/2,still,0\n", "not enough values"),
        (",".join(TRIAL_ROW_HEAD) + "\nslashes,still,0,1,1,,\n", "one row a trial"),
        (",".join(TRIAL_ROW_HEAD) + "\na/b/1/2,still,7,1,1,,\n", "begun with the seed 0; got 7"),
    ],
)
def test_files_that_hold_something_else_are_refused_and_kept(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "rows.csv"
    file.write_text(text)
    with pytest.raises(FileInputError, match=message):
        run_trials(trials(1), METHODS, file=file, resume=True)
    with pytest.raises(FileInputError, match="must be new"):
        run_trials(trials(1), METHODS, file=file)
    assert file.read_text() == text


def test_a_folder_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    with pytest.raises(FileInputError, match="must be writable"):
        run_trials(trials(1), METHODS, file=tmp_path / "taken" / "rows.csv")


@pytest.mark.parametrize("arguments", [{"seed": -1}, {"workers": 0}, {"workers": 1000}])
def test_values_out_of_range_are_refused(arguments: dict[str, int]) -> None:
    with pytest.raises(InputError, match="must lie in"):
        run_trials(trials(1), METHODS, **arguments)  # type: ignore[arg-type]


@pytest.mark.system
def test_processes_find_what_one_finds(tmp_path: Path) -> None:
    rows = run_trials(trials(), METHODS, workers=2, file=tmp_path / "rows.csv")
    assert without_time(rows) == without_time(run_trials(trials(), METHODS))
    assert len(read_trial_rows(tmp_path / "rows.csv")) == 8
