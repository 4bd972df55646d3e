"""``tsis demo``: frames, estimate and files, and the counts of ``--seeds``."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

import tsis
from tsis.catalog.phantoms import load_phantom
from tsis.cli.demo import stored_note
from tsis.virtual.examinations import coverage_counts

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import RunTsis


TARGETS, REFERENCES = (("target-0.5N.png", "target-1N.png"), ("reference-0.5N.png", "reference-1N.png"))
FILES = {"calibration.json", "index.html", "result.json", "untouched.png", *TARGETS, *REFERENCES}


def test_the_demo_writes_what_it_prints_and_finds_the_inclusion(run_tsis: RunTsis, tmp_path: Path) -> None:
    finished = run_tsis("demo", "--strain", "small", "--json", "--phantom", "size-8", "--seed", "3", "--out", "press")
    assert finished.code == 0, finished.err
    printed = json.loads(finished.out)
    folder = tmp_path / "press"
    assert printed.pop("folder") == str(folder)
    assert {path.name for path in folder.iterdir()} == FILES
    assert json.loads((folder / "result.json").read_text()) == printed
    assert printed["notice"].startswith("Research use only")
    assert [image["force_n"] for image in printed["estimate"]["provenance"]["images"]] == [0.5, 1.0]
    assert printed["estimate"]["trusted"] is True
    assert printed["estimate"]["presence"] > 0.999
    inclusion = load_phantom("size-8").inclusion
    assert inclusion is not None
    for name, found in printed["estimate"]["parameters"].items():
        truth = getattr(inclusion, name)
        assert found["truth"] == truth
        assert abs(found["mean"] - truth) < 3.5 * found["sd"]
        assert 0 < found["cramer_rao_sd"] < 100
    assert printed["estimate"]["parameters"]["diameter_mm"]["sd"] < 0.5
    assert printed["estimate"]["parameters"]["young_kpa"]["narrowing"] < 0.85


@pytest.mark.slow
def test_one_press_of_the_flat_probe_says_what_it_cannot_tell(run_tsis: RunTsis, tmp_path: Path) -> None:
    finished = run_tsis("demo", "--strain", "small", "--probe", "tsis-2011", "--force-n", "1", "--out", "press")
    assert finished.code == 0, finished.err
    assert "The modulus is not identifiable from this press" in " ".join(finished.out.split())
    assert {path.name for path in (tmp_path / "press").glob("*-*.png")} == {"target-1N.png", "reference-1N.png"}


def test_plain_tissue_is_told_from_an_inclusion(run_tsis: RunTsis) -> None:
    estimate = json.loads(run_tsis("demo", "--strain", "small", "--phantom", "plain", "--json").out)["estimate"]
    assert estimate["presence"] < 0.5
    assert "truth" not in estimate["parameters"]["diameter_mm"]


@pytest.mark.slow
def test_a_seed_repeats_everything_and_another_changes_it(run_tsis: RunTsis, tmp_path: Path) -> None:
    for folder, seed in (("a", "1"), ("b", "1"), ("c", "2")):
        assert run_tsis("demo", "--strain", "small", "--seed", seed, "--out", folder).code == 0
    same = [(tmp_path / folder / "index.html").read_bytes() for folder in "abc"]
    assert same[0] == same[1]
    assert same[0] != same[2]


def test_the_terminal_shows_what_was_believed_and_what_is_known_and_an_existing_folder_stays(
    run_tsis: RunTsis, tmp_path: Path
) -> None:
    (tmp_path / "press").mkdir()
    (tmp_path / "press" / "mine.txt").write_text("keep")
    finished = run_tsis("demo", "--strain", "small", "--out", "press")
    assert finished.code == 0, finished.err
    assert [path.name for path in (tmp_path / "press").iterdir()] == ["mine.txt"]
    assert (tmp_path / "press-2" / "index.html").is_file()
    frame = np.asarray(Image.open(tmp_path / "press-2" / TARGETS[1]))
    assert frame.shape == (492, 768)
    printed = " ".join(finished.out.split())
    for words in ("prior", "least sd", "truth", "Probability of an inclusion: above 0.999.", "Diameter 10"):
        assert words in printed
    assert "Prior: breast-ex-vivo: diameter 1 to 15 mm" in printed
    assert "Research use only" in printed


def test_a_stiffer_phantom_has_the_prior_of_the_phantoms(run_tsis: RunTsis) -> None:
    printed = " ".join(run_tsis("demo", "--strain", "small", "--phantom", "size-8").out.split())
    assert "Prior: phantom-2011: diameter 1 to 15 mm" in printed
    assert "lies outside the prior" not in printed


def test_a_truth_outside_the_prior_is_said(run_tsis: RunTsis) -> None:
    printed = " ".join(run_tsis("demo", "--strain", "small", "--diameter-mm", "0.8").out.split())
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
        (["--force-n", "0.5", "--force-n", "0.5"], "--force-n must name different forces; got 0.5, 0.5"),
        pytest.param(["--force-n", "0.1"], "at which the whole dome touches", marks=pytest.mark.slow),
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
    finished = run_tsis("demo", "--strain", "small", "--out", "file/press")
    assert finished.code == 2
    assert "must be a folder that can be made" in finished.err
    assert finished.err.count("\n") == 1


SMALL = ("demo", "--seeds", "1", "--seed", "5", "--strain", "small")


def test_the_counts_are_those_of_the_cases(run_tsis: RunTsis) -> None:
    finished = run_tsis(*SMALL, "--json")
    assert finished.code == 0, finished.err
    document = json.loads(finished.out)
    assert document["counts"] == coverage_counts(document["examinations"])
    assert [case["seed"] for case in document["examinations"]] == [5]
    assert document["protocol"]["prior"] == "breast-ex-vivo"
    people = run_tsis(*SMALL)
    assert "90 %, all 1" in " ".join(people.out.split()).replace("90%", "90 %")
    assert "Research use only" in people.out + people.err


@pytest.mark.parametrize(
    "typed",
    [["--diameter-mm", "9"], ["--phantom", "size-8"], ["--out", "folder"], ["--save"], ["--target", "3"]],
    ids=" ".join,
)
def test_options_of_one_examination_are_refused(run_tsis: RunTsis, typed: list[str]) -> None:
    finished = run_tsis(*SMALL, *typed)
    assert finished.code == 2
    assert f"leave out {typed[0]}" in " ".join(finished.err.split())


def test_the_note_names_the_stored_counts_and_their_command() -> None:
    stored = tsis.virtual.examinations.stored_coverage()
    held = stored["counts"]["held"]["0.9"]
    note = stored_note()
    assert f"diameter_mm {held['diameter_mm']}, depth_mm {held['depth_mm']}, young_kpa {held['young_kpa']}" in note
    assert stored["protocol"]["command"] in note
