"""``tsis simulate --scan`` and ``tsis map``: from a virtual scan to a page, JSON and volumes."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import RunTsis


def test_a_map_of_a_virtual_scan_holds_its_lump(run_tsis: RunTsis, tmp_path: Path) -> None:
    made = run_tsis(
        *("simulate", "--scan", "scan", "--lump", "3,-2,5,9,40", "--places", "3", "--seed", "23", "--json"),
    )
    assert made.code == 0, made.err
    assert json.loads(made.out)["lumps"] == json.loads((tmp_path / "scan" / "truth.json").read_text())["lumps"]
    finished = run_tsis("map", "scan", "--steps", "4000", "--out", "found", "--json")
    assert finished.code == 0, finished.err
    document = json.loads(finished.out)
    assert document["notice"].startswith("Research use only")
    found = document["lumps"][0]["estimate"]["parameters"]
    for name, truth in (("x_mm", 3.0), ("y_mm", -2.0), ("depth_mm", 5.0), ("diameter_mm", 9.0)):
        low, high = found[name]["interval_90"]
        assert low - 1.0 < truth < high + 1.0
    assert {"index.html", "result.json", "map.vti", "probability.dcm"} <= {
        path.name for path in (tmp_path / "found").iterdir()
    }


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["map"], "a scan must be given as a folder or a table, or by --target"),
        (["map", ".", "--target", "1"], "and not by both"),
        (["map", "nowhere"], "must be a folder with poses.csv"),
        (["map", ".", "--ball-mm", "2", "--punch-mm", "2"], "must not be given together"),
        (["simulate", "--scan", "s", "--lump", "1,2,3"], "--lump must be five numbers"),
        (["simulate", "--scan", "s", "--lump", "1,2,25,9,40"], "must be less than thickness_mm = 30"),
        (["simulate", "--scan", "s", "--place-sd-mm", "-1"], "place_sd_mm must lie in"),
    ],
)
def test_wrong_input_is_one_sentence(run_tsis: RunTsis, arguments: list[str], sentence: str) -> None:
    finished = run_tsis(*arguments)
    assert finished.code == 2
    assert sentence in finished.err
    assert finished.err.count("\n") == 1
