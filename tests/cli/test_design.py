"""The program's designs: what it prints, writes and refuses."""

from __future__ import annotations

import itertools
import json
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import RunTsis


def test_other_presses_are_compared(run_tsis: RunTsis, tmp_path: Path) -> None:
    """The press of one probe is solved once, for seconds; the rest is quick."""
    finished = run_tsis(
        *("design", "--probe", "tsis-2011", "--force-n", "0.8", "--compare", "reference", "--compare", "frames"),
        *("--criterion", "depth_mm", "--json", "--out", "made"),
    )
    assert finished.code == 0, finished.err
    document = json.loads(finished.out)
    assert document["notice"].startswith("Research use only")
    assert document["command"] == "design"
    designs = {one["name"]: one for one in document["designs"]}
    assert set(designs) == {
        "as planned",
        "without a reference",
        "frames of each press: 4",
        "frames of each press: 16",
    }
    errors = [one["expected_rmse"]["depth_mm"] for one in document["designs"]]
    assert errors == sorted(errors)
    assert document["designs"][-1]["name"] == "without a reference"
    planned = designs["as planned"]
    assert planned["presses"] == "tsis-2011, 0.8 N, with a reference"
    assert 0 < planned["limits"]["strain"] < 0.3
    for one in planned["inclusions"]:
        assert one["cramer_rao_sd"] is None or all(
            sd <= least * (1 + 1e-9) for sd, least in zip(one["expected_sd"], one["cramer_rao_sd"], strict=True)
        )
    assert {path.name for path in (tmp_path / "made").iterdir()} == {"result.json", "errors.png"}
    assert json.loads((tmp_path / "made" / "result.json").read_text())["designs"] == document["designs"]

    shown = run_tsis("design", "--probe", "tsis-2011", "--force-n", "5", "--no-reference", "--compare", "frames")
    assert shown.code == 0, shown.err
    text = " ".join(shown.out.split())
    assert "Research use only" in text
    assert "the limit of small strain is 0.3: press less." in text
    assert not (tmp_path / "tsis-design").exists()


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--force-n", "-1"], "force_n must lie in [0.001, 50]; got -1 (newtons)"),
        (["--frames", "0"], "frames_each must lie in [1, 1000]; got 0"),
        (["--probe", "tsis-1999"], "no probe is called 'tsis-1999'; did you mean 'tsis-2011'?"),
        (["--compare", "colour"], "'colour' is not one of 'softness', 'layers', 'dome', 'forces'"),
        (["--optimise", "--evaluations", "26"], "evaluations must lie in [1, 25]; got 26"),
        (["--evaluations", "5"], "--evaluations needs --optimise"),
    ],
)
def test_wrong_options_end_with_one_sentence(
    run_tsis: RunTsis, tmp_path: Path, arguments: list[str], sentence: str
) -> None:
    finished = run_tsis("design", "--out", "made", *arguments)
    assert finished.code == 2
    assert sentence in finished.err
    assert finished.err.count("\n") == 1
    assert finished.out == ""
    assert not (tmp_path / "made").exists()


def test_help_ends_with_an_example(run_tsis: RunTsis) -> None:
    assert "Example: tsis design --probe tsis-domed" in " ".join(run_tsis("design", "--help").out.split())


LIGHT = ("protocol", "--calibration", "demo/calibration.json", "--scale-mm", "0.0336,0.0392")


def test_a_known_tissue_has_its_forces(run_tsis: RunTsis) -> None:
    """At twice the modulus twice the force, less what the probe gives."""
    forces = [
        json.loads(run_tsis("protocol", "--tissue-kpa", kpa, "--json").out)["forces_n"] for kpa in ("5", "10", "20")
    ]
    assert forces[0] == [0.5, 1.0]
    for softer, stiffer in itertools.pairwise(forces):
        assert all(1.7 < more / less < 2.0 for less, more in zip(softer, stiffer, strict=True))


def test_a_press_on_tissue_tells_its_modulus(run: RunTsis) -> None:
    finished = run(*LIGHT, "demo/reference-0.5N.png", "--force-n", "0.5", "--json")
    assert finished.code == 0, finished.err
    document = json.loads(finished.out)
    low, high = document["tissue"]["interval_kpa"]
    assert low < 5.0 < high
    assert document["forces_n"][0] == pytest.approx(0.5, rel=0.2)
    assert "--tissue-kpa" in document["notes"][-1]


def test_an_untouched_probe_gives_no_forces(run: RunTsis) -> None:
    """There is no light, though a force is stated: no even tissue does that."""
    finished = run(*LIGHT, "demo/untouched.png", "--force-n", "1", "--json")
    assert finished.code == 3, finished.err
    document = json.loads(finished.out)
    assert (document["tissue"], document["forces_n"], document["trusted"]) == (None, [], False)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ([], "needs either the frame of a light press or --tissue-kpa"),
        (["light.png"], "a light press needs --calibration"),
        (["light.png", "--tissue-kpa", "5"], "needs either the frame of a light press or --tissue-kpa"),
        (["--tissue-kpa", "5000"], "tissue_young_kpa must lie in [0.75, 65]; got 5000 (kilopascals)"),
        (["--tissue-kpa", "5", "--thickness-mm", "0.03"], "thickness_mm must lie in [12.5, 72]; got 0.03"),
    ],
)
def test_a_protocol_refuses_wrong_options(run_tsis: RunTsis, arguments: list[str], sentence: str) -> None:
    finished = run_tsis("protocol", *arguments)
    assert finished.code == 2
    assert sentence in finished.err


def test_the_careful_protocol_repeats_the_forces(run_tsis: RunTsis) -> None:
    usual, careful = (
        json.loads(run_tsis("protocol", "--tissue-kpa", "5", "--protocol", name, "--json").out)
        for name in ("usual", "careful")
    )
    assert careful["forces_n"] == 4 * usual["forces_n"]
    assert usual["operator_s"] < careful["operator_s"] <= 300
    refused = run_tsis("protocol", "--tissue-kpa", "5", "--protocol", "quick")
    assert refused.code == 2
    assert "careful" in refused.err
