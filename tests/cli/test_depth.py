"""``tsis depth``."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

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
