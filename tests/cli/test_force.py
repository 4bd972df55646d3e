"""``tsis force``."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import cv2
import numpy as np
import pytest

from tsis.imaging.depth import DepthCalibration, depth_calibration_json

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import RunTsis


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    y, x = np.mgrid[:60, :80] - np.array([29.5, 39.5])[:, None, None]
    np.save(tmp_path / "depth.npy", np.clip(0.3 - (x**2 + y**2) / 600, 0.0, None))
    np.save(tmp_path / "flat.npy", np.zeros((60, 80)))
    np.save(tmp_path / "colour.npy", np.zeros((60, 80, 3)))
    (tmp_path / "text.npy").write_text("no array")
    return tmp_path


def test_a_known_weight_scales_the_force(run_tsis: RunTsis, folder: Path) -> None:
    finished = run_tsis("force", "depth.npy", "--weight", "depth.npy=0.5", "--json", "--out", "pressed")
    assert finished.code == 0, finished.err
    document = json.loads(finished.out)
    assert document["force_n"] == pytest.approx(0.5)
    assert document["interval_n"][0] < 0.5 < document["interval_n"][1]
    folder_name = document["folder"]
    pressure = np.load(folder / folder_name / "pressure_kpa.npy")
    assert pressure.sum() * 0.2528**2 / 1000 == pytest.approx(0.5, rel=1e-3)
    assert (folder / folder_name / "pressure.png").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((), "give one depth map as an NPY file, or --demo"),
        (("none.npy",), "'none.npy' does not exist"),
        (("text.npy",), "text.npy must be an NPY file"),
        (("colour.npy",), "must hold numbers in rows and columns; got (60, 80, 3)"),
        (("flat.npy",), "no pixel is pressed in by more than 0.03 mm"),
        (("depth.npy", "--markers", "press.png"), "--markers needs a frame of the untouched sensor"),
        (("depth.npy", "--reference", "none.png"), "--reference must be given with --calibration or --markers"),
        (
            ("depth.npy", "--calibration", "none.json", "--markers", "none.png"),
            "--markers must be given with a depth map",
        ),
        (("--demo", "--calibration", "none.json"), "--demo must be given without --calibration"),
        (("depth.npy", "--weight", "depth.npy=0.5", "--weight", "./depth.npy=0.6"), "must name each press once"),
        (("depth.npy", "--weight", "depth.npy"), "as press.npy=0.5; got 'depth.npy'"),
    ],
)
def test_wrong_input_ends_in_one_sentence(
    run_tsis: RunTsis, folder: Path, arguments: tuple[str, ...], said: str
) -> None:
    finished = run_tsis("force", *arguments)
    assert finished.code == 2
    assert said in " ".join(finished.err.split())
    assert finished.err.count("\n") == 1
    assert folder.exists()


@pytest.mark.parametrize(
    ("weights", "said"),
    [
        (("depth.npy=50",), "check the unit (newtons)"),
        (("half.npy=0.4",), "a press of a known force: the contact reaches the border of the map"),
        (("depth.npy=0.25", "deeper.npy=4"), "the presses of known forces scatter by"),
    ],
)
def test_a_weight_that_cannot_be_right_is_told(
    run_tsis: RunTsis, folder: Path, weights: tuple[str, ...], said: str
) -> None:
    depth = np.load(folder / "depth.npy")
    np.save(folder / "half.npy", np.roll(depth, 40, axis=1))
    np.save(folder / "deeper.npy", 1.3 * depth)
    given = [part for weight in weights for part in ("--weight", weight)]
    finished = run_tsis("force", "depth.npy", *given, "--json")
    assert finished.code == 3, finished.err
    assert not json.loads(finished.out)["trusted"]
    assert said in " ".join(run_tsis("force", "depth.npy", *given).out.split())


def test_a_video_has_the_force_of_each_depth(run_tsis: RunTsis, tmp_path: Path) -> None:
    """Grey levels that fall by 60 a millimetre: the video's forces are those of the depth maps themselves."""
    calibration = DepthCalibration(
        sensor="9dtact", light="white", method="grey", weights=np.array([-60.0, 0.0, 0.0]), ball_mm=6.0, presses=3,
        sd_mm=0.004, sd_relative=0.02,
    )  # fmt: skip
    (tmp_path / "depth.json").write_bytes(depth_calibration_json(calibration))
    y, x = np.mgrid[:344, :460] * 0.0505
    bowl = np.exp(-((x - 11.6) ** 2 + (y - 8.7) ** 2) / 2 / 2.0**2)
    writer = cv2.VideoWriter(str(tmp_path / "press.mkv"), cv2.VideoWriter.fourcc(*"FFV1"), 10.0, (460, 344))
    for deepest in (0.0, 0.25, 0.5):
        levels = np.rint(160.0 - 60.0 * deepest * bowl).astype(np.uint8)
        writer.write(np.dstack([levels] * 3))
        np.save(tmp_path / f"map-{deepest:g}.npy", deepest * bowl)
    writer.release()
    made = run_tsis("sensor", "new", "even", "--like", "9dtact", "--image-px", "460,344", "--out", "even.toml")
    assert made.code == 0, made.err
    finished = run_tsis("force", "press.mkv", "--sensor", "even.toml", "--calibration", "depth.json", "--json")
    assert finished.code in (0, 3), finished.err
    rows = json.loads(finished.out)["frames"]
    assert [row["time_s"] for row in rows] == pytest.approx([0.0, 0.1, 0.2])
    assert rows[0]["force_n"] == 0.0
    for row, deepest in zip(rows[1:], (0.25, 0.5), strict=True):
        known = json.loads(run_tsis("force", f"map-{deepest:g}.npy", "--sensor", "even.toml", "--json").out)["force_n"]
        assert row["force_n"] == pytest.approx(known, rel=0.08)
        assert row["interval_n"][0] < known < row["interval_n"][1]
