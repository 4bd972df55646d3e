"""The benchmark data set: the same bytes from one seed, truths apart from frames, and a scorer checked by hand."""

from __future__ import annotations

import csv
import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from benchmarks.data_set import Recipe, answer_bytes, dummy_answer, make, own_answer, presses_of, require_unchanged
from benchmarks.data_set_score import COLUMNS, NUMBERS, Row, interval_score, read_rows, scores
from benchmarks.simulated_presses import SimulatedCase

import tsis
from benchmarks import data_set
from tsis.errors import FileInputError
from tsis.inclusion.prior import PARAMETERS
from tsis.model.image import TactileImage

if TYPE_CHECKING:
    from pathlib import Path

RECIPE = Recipe(worlds=("as-model", "finite"), cases=2, blanks=1, seed=5)


def drawn_case(recipe: Recipe, world: str, blank: bool, index: int) -> SimulatedCase:
    rng = np.random.default_rng([recipe.seed, recipe.worlds.index(world), blank, index])
    phantom = tsis.load_phantom("plain" if blank else "hardness-100")
    frames = [
        TactileImage(grey=rng.integers(0, 200, (6, 8)).astype(float), force_n=force, mm_per_pixel=(0.1, 0.2))
        for force in (0.5, 1.0, 0.5, 1.0)
    ]
    calibration = tsis.Calibration(gain_grey_per_kpa=1.0, saturation_kpa=100.0)
    return SimulatedCase(
        phantom=phantom, frames=tuple(frames[:2]), references=tuple(frames[2:]), calibration=calibration
    )


@pytest.fixture
def quick_presses(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(data_set, "simulated", drawn_case)
    known = tsis.Calibration(gain_grey_per_kpa=1.0, saturation_kpa=100.0, probe="tsis-domed")
    monkeypatch.setattr(data_set, "believed", lambda _: known)


@pytest.mark.usefixtures("quick_presses")
def test_one_seed_gives_the_same_bytes_also_after_an_interruption(tmp_path: Path) -> None:
    whole = make(tmp_path / "a", RECIPE)
    (tmp_path / "b" / "frames").mkdir(parents=True)
    (tmp_path / "b" / "cases").mkdir()
    data_set.write_case(tmp_path / "b", RECIPE, 3)
    assert make(tmp_path / "b", RECIPE) == whole
    assert make(tmp_path / "c", Recipe(worlds=RECIPE.worlds, cases=2, blanks=1, seed=6)) != whole
    with pytest.raises(FileInputError, match="another recipe"):
        make(tmp_path / "a", Recipe(worlds=RECIPE.worlds, cases=2, blanks=1, seed=6))


@pytest.mark.usefixtures("quick_presses")
def test_the_truth_lies_in_its_own_file_and_every_file_has_its_hash(tmp_path: Path) -> None:
    make(tmp_path, RECIPE)
    presses = presses_of(tmp_path)
    assert len(presses) == 6
    assert {len(case.frames[site]) for case in presses.values() for site in ("target", "reference")} == {2}
    assert sorted(case.strain for case in presses.values()) == ["finite"] * 3 + ["small"] * 3
    with (tmp_path / "truth.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert sorted((row["world"], row["diameter_mm"]) for row in rows) == sorted(
        [("as-model", "10"), ("as-model", "10"), ("as-model", ""), ("finite", "10"), ("finite", "10"), ("finite", "")]
    )
    assert "as-model" not in (tmp_path / "presses.csv").read_text()
    require_unchanged(tmp_path)
    frame = next((tmp_path / "frames").iterdir())
    frame.write_bytes(frame.read_bytes()[:-1])
    with pytest.raises(FileInputError, match="missing or was changed"):
        require_unchanged(tmp_path)


@pytest.mark.usefixtures("quick_presses")
def test_the_metadata_hold_what_archives_demand(tmp_path: Path) -> None:
    make(tmp_path, RECIPE)
    about = json.loads((tmp_path / "datacite.json").read_text())
    assert {"titles", "creators", "publisher", "publicationYear", "types", "schemaVersion"} <= set(about)
    assert about["types"]["resourceTypeGeneral"] == "Dataset"
    assert about["rightsList"][0]["rightsIdentifier"] == "CC-BY-4.0"
    assert RECIPE.command in json.dumps(json.loads((tmp_path / "codemeta.json").read_text()))
    assert "Research use only" in (tmp_path / "README.md").read_text()


@pytest.mark.usefixtures("quick_presses")
def test_a_dummy_is_scored_and_what_cannot_be_estimated_is_no_answer(tmp_path: Path) -> None:
    make(tmp_path, RECIPE)
    cases = presses_of(tmp_path)
    assert own_answer(tmp_path, next(iter(cases.values()))) == {}
    (tmp_path / "answers.csv").write_bytes(answer_bytes({case: dummy_answer() for case in cases}))
    rows = scores(read_rows(tmp_path / "truth.csv", PARAMETERS), read_rows(tmp_path / "answers.csv", NUMBERS))
    assert [row[:2] for row in rows] == [
        *(("as-model", name) for name in PARAMETERS),
        *(("finite", name) for name in PARAMETERS),
        ("all", "presence"),
    ]
    diameter, presence = rows[0], rows[-1]
    assert diameter[2:] == ("2", "2", "20 %", "2", "2", "100 %", "12.6")  # 8 for 10 mm; 90 % of 1 to 15 mm
    assert presence[2:6] == ("6", "6", "AUC 0.500", "Brier 0.250")


def test_an_interval_that_misses_pays_twenty_times_the_distance() -> None:
    low, high, truth = np.array([1.0, 1.0, 1.0]), np.array([3.0, 3.0, 3.0]), np.array([2.0, 0.5, 3.25])
    assert interval_score(low, high, truth).tolist() == pytest.approx([2.0, 12.0, 7.0])


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("0001,8,6,10,5,,,,,0.5\n0001,8,6,10,5,,,,,0.5", "name a case once"),
        ("0001,x,,,,,,,,", "finite number or empty"),
        ("0001,nan,,,,,,,,", "finite number or empty"),
        ("0001,8,9,7,,,,,,", "at most diameter_mm_high"),
        ("0001,,,,,,,,,,1.5", "probability"),
        ("0009,8,,,,,,,,", "this data set's cases"),
    ],
)
def test_answers_that_cannot_be_scored_are_refused(tmp_path: Path, row: str, said: str) -> None:
    (tmp_path / "answers.csv").write_text(",".join(COLUMNS) + "\n" + row + "\n")
    truths: dict[str, Row] = {"0001": {"world": "w", "diameter_mm": 8.0, "depth_mm": 5.0, "young_kpa": 60.0}}
    with pytest.raises(FileInputError, match=said):
        scores(truths, read_rows(tmp_path / "answers.csv", NUMBERS))
