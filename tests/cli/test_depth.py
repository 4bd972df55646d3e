"""``tsis depth``."""

from __future__ import annotations

import json
import shutil
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image
from tests.cli.published import faults

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import RunTsis


def test_calibrate_and_map(run_tsis: RunTsis, tmp_path: Path) -> None:
    assert run_tsis("sensor", "new", "mine", "--image-px", "160,120", "--scale-mm", "0.1264").code == 0
    assert run_tsis("sensor", "frames", "sensor.toml", "--presses", "4", "--seed", "3").code == 0
    common = ("--sensor", "sensor.toml", "--reference", "gel-frames/untouched.png")
    presses = [f"gel-frames/press-{number}.png" for number in (1, 2, 3)]
    made = run_tsis("depth", "calibrate", *presses, *common, "--ball-mm", "6", "--json")
    assert made.code == 0, made.err
    assert json.loads(made.out)["presses"] == 3
    mapped = run_tsis("depth", "gel-frames/press-4.png", *common, "--calibration", "depth.json", "--json")
    assert mapped.code == 0, mapped.err
    depth, sd = (np.load(tmp_path / "depth-maps" / f"press-4{ending}.npy") for ending in ("", "-sd"))
    assert depth.shape == (120, 160)
    assert abs(json.loads(mapped.out)["maps"][0]["deepest_mm"] - depth.max()) < 1e-6
    assert sd.min() > 0
    with Image.open(tmp_path / "depth-maps" / "press-4.tiff") as image:
        assert np.array_equal(np.asarray(image), depth)
    assert (tmp_path / "depth-maps" / "press-4.ply").read_bytes().startswith(b"ply\n")
    missing = run_tsis("depth", "gel-frames/press-4.png", "--sensor", "sensor.toml", "--calibration", "depth.json")
    assert missing.code == 2
    assert "give it as --reference" in missing.err


def test_maps_of_frames_of_one_name_are_all_kept(run_tsis: RunTsis, tmp_path: Path) -> None:
    assert run_tsis("sensor", "new", "mine", "--image-px", "160,120", "--scale-mm", "0.1264").code == 0
    assert run_tsis("sensor", "frames", "sensor.toml", "--presses", "5", "--seed", "3").code == 0
    frames = tmp_path / "gel-frames"
    common = ("--sensor", "sensor.toml", "--reference", str(frames / "untouched.png"))
    presses = [str(frames / f"press-{number}.png") for number in (1, 2, 3)]
    assert run_tsis("depth", "calibrate", *presses, *common, "--ball-mm", "6").code == 0
    given = []
    for name, number in (("a/press", 4), ("b/press", 5), ("b/Press-2", 4), ("b/press-sd", 5)):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(frames / f"press-{number}.png", tmp_path / f"{name}.png")
        given.append(f"{name}.png")
    done = run_tsis("depth", *given, *common, "--calibration", "depth.json", "--json")
    assert done.code == 0, done.err
    document = json.loads(done.out)
    assert faults(document) == []
    maps = document["maps"]
    assert [one["map"] for one in maps] == ["press", "press-3", "Press-2", "press-sd-2"]
    for one in maps:
        depth = np.load(tmp_path / "depth-maps" / f"{one['map']}.npy")
        assert depth.max() == pytest.approx(one["deepest_mm"], abs=1e-6)
        assert np.load(tmp_path / "depth-maps" / f"{one['map']}-sd.npy").shape == depth.shape
        assert (one["problems"], one["notes"]) == ([], [])
    swapped = ("--sensor", "sensor.toml", "--reference", "a/press.png", "--calibration", "depth.json", "--json")
    done = run_tsis("depth", str(frames / "untouched.png"), *swapped)
    assert done.code == 3
    assert "may be swapped" in json.loads(done.out)["maps"][0]["problems"][0]
