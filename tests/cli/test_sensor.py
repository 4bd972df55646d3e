"""``tsis sensor``."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from tsis.catalog.sensors import list_sensors, load_sensor

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import RunTsis


def test_new_check_and_show_go_together(run_tsis: RunTsis, tmp_path: Path) -> None:
    made = run_tsis("sensor", "new", "mine", "--scale-mm", "0.06", "--image-px", "640,480", "--young-kpa", "160")
    assert made.code == 0, made.err
    sensor = load_sensor(tmp_path / "sensor.toml")
    assert (sensor.mm_per_pixel, sensor.image_px, sensor.young_kpa.limits) == ((0.06, 0.06), (640, 480), (160.0, 160.0))
    assert sensor.sources["young_kpa"] == "given by the user"
    Image.fromarray(np.zeros((120, 160, 3), np.uint8)).save(tmp_path / "frame.png")
    assert run_tsis("sensor", "check", "sensor.toml", "frame.png").code == 0
    shown = json.loads(run_tsis("sensor", "show", "sensor.toml", "--json").out)
    assert shown["sensor"]["thickness_mm"] == {"value": 4.0, "low": 3.0, "high": 5.0}


def test_corners_are_found_in_an_untouched_frame(run_tsis: RunTsis, tmp_path: Path) -> None:
    frame = np.full((480, 640, 3), 5, np.uint8)
    y, x = np.mgrid[:480, :640]
    inside = (y > 60 + 0.05 * x) & (y < 430 - 0.03 * x) & (x > 80 + 0.1 * y) & (x < 560 + 0.06 * y)
    frame[inside] = (120, 140, 160)
    Image.fromarray(frame).save(tmp_path / "untouched.png")
    made = run_tsis("sensor", "new", "mine", "--like", "gelsight-wedge", "--corners-in", "untouched.png")
    assert made.code == 0, made.err
    sensor = load_sensor(tmp_path / "sensor.toml")
    assert sensor.raw_px == (640, 480)
    assert sensor.corners_px is not None
    (left, top), (_, right_top), *_ = sensor.corners_px
    assert left == pytest.approx(80 + 0.1 * top, abs=2)
    assert top == pytest.approx(60 + 0.05 * left, abs=2)
    assert right_top == pytest.approx(60 + 0.05 * 565, abs=3)
    twice = run_tsis("sensor", "new", "mine", "--corners-in", "untouched.png", "--raw-px", "640,480", "--out", "b.toml")
    assert twice.code == 2
    assert "--corners-in must stand without" in twice.err


def test_show_lists_the_catalog(run_tsis: RunTsis) -> None:
    assert json.loads(run_tsis("sensor", "show", "--json").out)["names"] == list(list_sensors())
    assert "not a layer" in " ".join(run_tsis("sensor", "show", "digit").out.split())


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("check", "none.toml"), "it does not exist: make one with tsis sensor new"),
        (("show", "gelsight"), "did you mean 'gelsight-mini'"),
        (("new", "digit"), "choose another, as my-digit"),
        (("new", "mine", "--image-px", "320"), "--image-px must be columns and rows, as 320,240; got '320'"),
        (("new", "mine", "--image-px", "640,480"), "--image-px must be given with --scale-mm, the scale of its frames"),
        (("new", "mine", "--young-measured"), "--young-measured must be given with --young-kpa"),
        (("new", "mine", "--young-kpa", "-3"), "young_kpa must lie in [0.1, 1e+06]; got -3"),
    ],
)
def test_wrong_input_ends_in_one_sentence(run_tsis: RunTsis, arguments: tuple[str, ...], said: str) -> None:
    finished = run_tsis("sensor", *arguments)
    assert finished.code == 2
    assert said in " ".join(finished.err.split())
    assert finished.err.count("\n") == 1
