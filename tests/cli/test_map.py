"""``tsis simulate --scan`` and ``tsis map``: from a virtual scan to a page, JSON and volumes."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
from tests.records.stored_tray import PIXELS, tray_calibration, write_tray

from tsis.calibration.file import calibration_bytes

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


def test_a_map_is_kept_shown_made_again_and_carried_to_another_store(run_tsis: RunTsis, tmp_path: Path) -> None:
    write_tray(tmp_path / "tray")
    (tmp_path / "known.json").write_bytes(calibration_bytes(tray_calibration()))
    frames = ("tray", "--calibration", "known.json", "--scale-mm", "{},{}".format(*PIXELS))
    quick = ("--steps", "1000", "--voxel-mm", "5", "--store", "records", "--save", "--json")
    finished = run_tsis("map", *frames, *quick, "--target", "4")
    assert finished.code == 0, finished.err
    document = json.loads(finished.out)
    assert document["saved"]["target"] == 4
    assert json.loads((tmp_path / "tsis-map" / "result.json").read_text())["saved"] == document["saved"]

    (stored,) = json.loads(run_tsis("records", "show", "4", "--store", "records", "--json").out)["maps"]
    assert stored["id"] == document["saved"]["map"]
    for name in ("lumps", "flags", "notes", "left_out", "count_probability", "next_places", "places_mm"):
        assert stored[name] == document[name]
    shown = run_tsis("records", "show", "4", "--store", "records").out
    assert "Current map: Lumps, 90 % intervals" in shown
    assert "Research use only" in " ".join(shown.split())

    again = json.loads(run_tsis("records", "recompute", "4", "--store", "records", "--json").out)
    (recomputed,) = again["estimates"]
    assert (recomputed["kind"], recomputed["same"], recomputed["stored_as"]) == ("map", True, None)

    assert run_tsis("records", "export", "4", "--store", "records", "--format", "bundle", "--out", "4.zip").code == 0
    assert run_tsis("records", "import", "4.zip", "--store", "other").code == 0
    (carried,) = json.loads(run_tsis("records", "show", "4", "--store", "other", "--json").out)["maps"]
    assert carried == stored

    # The presses are there now: a map of the target itself is its newest result, and equal.
    finished = run_tsis("map", *quick, "--target", "4")
    assert finished.code == 0, finished.err
    first, second = json.loads(run_tsis("records", "show", "4", "--store", "records", "--json").out)["maps"]
    assert second["lumps"] == first["lumps"]
    assert second["presses"] == first["presses"]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["map"], "a scan must be given as a folder or a table, or by --target"),
        (["map", ".", "--target", "1"], "and not by both"),
        (["map", "nowhere"], "must be a folder with poses.csv"),
        (["map", ".", "--ball-mm", "2", "--punch-mm", "2"], "must not be given together"),
        (["map", "robot.csv", "--ball-mm", "2", "--save", "--store", "r"], "--save needs a scan of frames"),
        (["map", ".", "--probe", "mine.toml", "--save"], "needs a probe of the catalog"),
        (["map", ".", "--store", "r"], "--store needs --save"),
        (["map", "--target", "1", "--ball-mm", "2"], "a target has frames and scale"),
        (["simulate", "--scan", "s", "--lump", "1,2,3"], "--lump must be five numbers"),
        (["simulate", "--scan", "s", "--lump", "1,2,25,9,40"], "must be less than thickness_mm = 30"),
        (["simulate", "--scan", "s", "--place-sd-mm", "-1"], "place_sd_mm must lie in"),
    ],
)
def test_wrong_input_is_one_sentence(run_tsis: RunTsis, tmp_path: Path, arguments: list[str], sentence: str) -> None:
    rows = (f"{press},{10 * press},0,{travel},{travel / 10}\n" for press in (1, 2, 3) for travel in (1, 2))
    (tmp_path / "robot.csv").write_text("press,x_mm,y_mm,travel_mm,force_n\n" + "".join(rows))
    finished = run_tsis(*arguments)
    assert finished.code == 2
    assert sentence in finished.err
    assert finished.err.count("\n") == 1
