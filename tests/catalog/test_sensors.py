"""Gel sensors: their values, their files, and what is refused."""

from __future__ import annotations

import pickle
import tomllib
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from tsis.catalog.probes import list_probes, load_probe
from tsis.catalog.sensors import list_sensors, load_sensor, parse_sensor, sensor_toml
from tsis.errors import FileInputError, ImageMismatchError, InputError, UnknownNameError
from tsis.model.gel_sensor import BoundedValue, GelSensor, gel_sensor_of_probe

if TYPE_CHECKING:
    from pathlib import Path

SHIPPED = [name for name in list_sensors() if name not in list_probes()]


def entry() -> dict[str, Any]:
    return {"width_mm": 20.0, "height_mm": 15.0, "thickness_mm": 4.0, "young_kpa": [100, 200], "poisson": 0.49}


def test_the_issue_s_four_sensors_ship() -> None:
    assert {"gelsight-mini", "gelsight-wedge", "digit", "9dtact"} <= set(SHIPPED)


@pytest.mark.parametrize("name", list_sensors())
def test_a_sensor_survives_its_file_and_a_pickle(name: str, tmp_path: Path) -> None:
    sensor = replace(load_sensor(name), name="mine")
    (tmp_path / "mine.toml").write_text(sensor_toml(sensor), encoding="utf-8")
    assert load_sensor(tmp_path / "mine.toml") == sensor
    assert pickle.loads(pickle.dumps(sensor)) == sensor


@pytest.mark.parametrize("name", SHIPPED)
def test_every_mechanical_value_names_its_source_and_unknown_ones_have_limits(name: str) -> None:
    sensor = load_sensor(name)
    for key in ("width_mm", "height_mm", "thickness_mm", "young_kpa", "poisson", "image_px"):
        assert sensor.sources[key], key
    assert not sensor.young_kpa.exact
    assert sensor.mm_per_pixel is None or sensor.sources["mm_per_pixel"]


def test_the_face_and_the_scale_agree_where_both_are_published() -> None:
    for name in ("gelsight-wedge", "gelsight-taxim", "9dtact"):
        sensor = load_sensor(name)
        assert sensor.mm_per_pixel is not None
        seen = np.multiply(sensor.image_px, sensor.mm_per_pixel)
        assert seen == pytest.approx((sensor.width_mm, sensor.height_mm), rel=0.1)


def test_a_probe_is_a_sensor_with_its_stack_in_series() -> None:
    sensor = load_sensor("tsis-2011")
    assert sensor == gel_sensor_of_probe(load_probe("tsis-2011"))
    assert sensor.young_kpa.best == pytest.approx(10.0 / (2 / 140 + 3 / 80 + 5 / 34))
    assert sensor.young_kpa.limits == (34.0, 140.0)
    assert load_sensor("tsis-domed").face_radius_mm == 40.0


def test_scale_follows_the_size_of_the_frame() -> None:
    sensor = load_sensor("gelsight-taxim")
    assert sensor.scale_of(160, 120) == pytest.approx((0.118, 0.118))
    with pytest.raises(ImageMismatchError, match="aspect ratio of 640 x 480 pixels; got 160 x 160"):
        sensor.scale_of(160, 160)
    with pytest.raises(ImageMismatchError, match="must have 460 x 345 pixels; got 640 x 480: rectify"):
        load_sensor("9dtact").scale_of(640, 480)


def test_distortion_is_taken_away() -> None:
    sensor = replace(load_sensor("gelsight-taxim"), distortion=(-0.12, 0.02))
    straight = np.array([[0.3, -0.2], [0.0, 0.0], [-0.7, 0.6]])
    squared = np.square(straight).sum(axis=1, keepdims=True)
    half = np.hypot(640, 480) / 2
    seen = straight * (1 - 0.12 * squared + 0.02 * squared**2) * half + (319.5, 239.5)
    assert sensor.face_mm(seen, 640, 480) == pytest.approx(straight * half * 0.0295, abs=1e-9)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"young_kpa": [200, 100]}, "value must lie between low = 200 and high = 100"),
        ({"young_kpa": "soft"}, "young_kpa must be a number, limits as"),
        ({"young_kpa": {"value": 1, "top": 2}}, "no part of young_kpa is called 'top'"),
        ({"young_kpa": {"value": 1, "low": 2}}, "must have low and high, or be one number"),
        ({"poisson": 0.5}, "poisson must lie in"),
        ({"colour": "rgb"}, "no value of a sensor is called 'colour'"),
        ({"light": "uv"}, "no light of a sensor is called 'uv'"),
        ({"shape": "domed"}, "face_radius_mm must be given for a domed face"),
        ({"face_radius_mm": 30.0}, "face_radius_mm must be left out for a flat face"),
        ({"outline": "round"}, "height_mm of a round face must be width_mm"),
        ({"image_px": [320]}, "image_px must hold two numbers"),
        ({"image_px": 320}, "image_px must be a list"),
        ({"mm_per_pixel": [0.0, 0.1]}, "mm_per_pixel must lie in"),
        ({"layers": [{"young_kpa": 3.0}]}, "a layer must give thickness_mm and young_kpa"),
        ({"sources": {"gel": "a paper"}}, "no value of a sensor with a source is called 'gel'"),
        ({"resampled": 1}, "resampled must be a bool"),
        ({"thickness_mm": None}, "thickness_mm must be a number, limits as"),
    ],
)
def test_a_wrong_value_is_refused_in_one_sentence(change: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said.replace("[", r"\[")) as error:
        parse_sensor("mine", entry() | change)
    assert "\n" not in str(error.value)


def test_a_missing_value_is_named() -> None:
    with pytest.raises(InputError, match="must give young_kpa, poisson; got none"):
        parse_sensor("mine", {key: entry()[key] for key in ("width_mm", "height_mm", "thickness_mm")})


def test_files_that_hold_no_sensor(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    with pytest.raises(FileInputError, match="it does not exist: make one with tsis sensor new"):
        load_sensor(file)
    for text, said in (("a = 1\n", "must hold one sensor"), ("[digit]\n", "that of a sensor of the catalog")):
        file.write_text(text)
        with pytest.raises(FileInputError, match=said):
            load_sensor(file)
    with pytest.raises(UnknownNameError, match="did you mean 'gelsight-mini'"):
        load_sensor("gelsight-mino")


def test_the_reference_lies_beside_the_file(tmp_path: Path) -> None:
    sensor = replace(load_sensor("9dtact"), name="mine", reference_file="untouched.png")
    (tmp_path / "mine.toml").write_text(sensor_toml(sensor), encoding="utf-8")
    assert load_sensor(tmp_path / "mine.toml").reference_file == str(tmp_path / "untouched.png")
    assert tomllib.loads(sensor_toml(sensor))["mine"]["reference_file"] == "untouched.png"


def test_an_exact_value_prints_as_one_number() -> None:
    assert str(BoundedValue(value=5.5)) == "5.5"
    assert str(BoundedValue(low=1.0, high=3.0)) == "2 (1 to 3)"


def test_a_sensor_shows_itself_in_a_notebook() -> None:
    sensor = load_sensor("digit")
    assert isinstance(sensor, GelSensor)
    assert "to be calibrated" in sensor._repr_html_()
