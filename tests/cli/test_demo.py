from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from tsis import load_phantom

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import RunTsis

FILES = {"calibration.json", "index.html", "reference.png", "result.json", "target.png", "untouched.png"}


def test_the_demo_writes_what_it_prints_and_finds_the_inclusion(run_tsis: RunTsis, tmp_path: Path) -> None:
    finished = run_tsis("demo", "--json", "--phantom", "size-8", "--seed", "3", "--out", "press")
    assert finished.code == 0, finished.err
    printed = json.loads(finished.out)
    folder = tmp_path / "press"
    assert printed.pop("folder") == str(folder)
    assert {path.name for path in folder.iterdir()} == FILES
    assert json.loads((folder / "result.json").read_text()) == printed
    assert printed["notice"].startswith("Research use only")
    inclusion = load_phantom("size-8").inclusion
    assert inclusion is not None
    for name, found in printed["estimate"]["parameters"].items():
        truth = getattr(inclusion, name)
        assert found["truth"] == truth
        assert abs(found["mean"] - truth) < 3.5 * found["sd"]
    assert printed["estimate"]["parameters"]["diameter_mm"]["sd"] < 0.5


def test_the_frames_are_those_that_were_estimated(run_tsis: RunTsis, tmp_path: Path) -> None:
    run_tsis("demo", "--json", "--seed", "5", "--out", "press")
    target = np.asarray(Image.open(tmp_path / "press" / "target.png"), dtype=float)
    examined = run_tsis(
        *("examine", "press/target.png", "--plain", "press/reference.png", "--calibration", "press/calibration.json"),
        *("--force-n", "1", "--scale-mm", "0.0336,0.0392", "--json"),
    )
    assert examined.code == 0, examined.err
    again = json.loads(examined.out)["estimate"]
    first = json.loads((tmp_path / "press" / "result.json").read_text())["estimate"]
    for name, found in again["parameters"].items():
        assert found["mean"] == pytest.approx(first["parameters"][name]["mean"], rel=1e-12)
    assert first["provenance"]["images"][0]["sha256"] == again["provenance"]["images"][0]["sha256"]
    assert target.shape == (492, 768)


def test_a_seed_repeats_everything_and_another_changes_it(run_tsis: RunTsis, tmp_path: Path) -> None:
    for folder, seed in (("a", "1"), ("b", "1"), ("c", "2")):
        assert run_tsis("demo", "--seed", seed, "--out", folder).code == 0
    same = [(tmp_path / folder / "index.html").read_bytes() for folder in "abc"]
    assert same[0] == same[1]
    assert same[0] != same[2]


def test_an_existing_folder_is_left_alone(run_tsis: RunTsis, tmp_path: Path) -> None:
    (tmp_path / "press").mkdir()
    (tmp_path / "press" / "mine.txt").write_text("keep")
    assert run_tsis("demo", "--out", "press").code == 0
    assert [path.name for path in (tmp_path / "press").iterdir()] == ["mine.txt"]
    assert (tmp_path / "press-2" / "index.html").is_file()


def test_the_table_says_what_is_not_identified(run_tsis: RunTsis) -> None:
    finished = run_tsis("demo")
    assert "not identified" in finished.out
    assert "The modulus is not identifiable from this press" in finished.out
    assert "Research use only" in finished.out
    assert "truth" in finished.out


def test_a_truth_outside_the_prior_is_said(run_tsis: RunTsis) -> None:
    printed = " ".join(run_tsis("demo", "--diameter-mm", "0.8").out.split())
    assert "The true diameter_mm 0.8 lies outside the prior's 1 to 15" in printed
    assert "true depth_mm" not in printed


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--phantom", "hardnes-100"], "no phantom is called 'hardnes-100'; did you mean 'hardness-100'?"),
        (["--probe", "tsis2011"], "no probe is called 'tsis2011'; did you mean 'tsis-2011'?"),
        (["--depth-mm", "25"], "depth_mm + diameter_mm must be less than thickness_mm = 30; got 35"),
        (["--diameter-mm", "-1"], "diameter_mm must lie in [0.1, 100]; got -1"),
        (["--young-kpa", "nan"], "young_kpa must lie in [0.1, 1e+06]; got nan"),
        (["--force-n", "inf"], "force_n must lie in [0.0001, 20]; got inf"),
        (["--force-n", "1000"], "force_n must lie in [0.0001, 20]; got 1000 (newtons)"),
        (["--phantom", "plain"], "phantom must hold an inclusion"),
    ],
)
def test_wrong_input_is_one_sentence_and_writes_nothing(
    run_tsis: RunTsis, tmp_path: Path, arguments: list[str], sentence: str
) -> None:
    finished = run_tsis("demo", *arguments)
    assert finished.code == 2
    assert finished.out == ""
    assert finished.err.startswith("Error: ")
    assert sentence in finished.err
    assert finished.err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_made_is_one_sentence(run_tsis: RunTsis, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    finished = run_tsis("demo", "--out", "file/press")
    assert finished.code == 2
    assert "must be a folder that can be made" in finished.err
    assert finished.err.count("\n") == 1
