"""The program's designs: what it prints, writes and refuses."""

from __future__ import annotations

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
