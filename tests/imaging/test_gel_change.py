"""Frames of gel sensors as levels: warped to the face, scaled by their bits, freed of a change of the light."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from skimage.transform import ProjectiveTransform, warp

from tsis.catalog.sensors import load_sensor, parse_sensor, sensor_toml
from tsis.errors import ImageMismatchError, InputError
from tsis.files.reading import parse_toml
from tsis.imaging.gel_change import face_view, gel_levels, light_change
from tsis.virtual.gel_frames import random_gel_press

if TYPE_CHECKING:
    from tsis.model.gel_sensor import GelSensor

CORNERS = ((90.0, 60.0), (560.0, 75.0), (600.0, 440.0), (50.0, 425.0))


def own_wedge(**changes: Any) -> GelSensor:
    document = parse_toml(sensor_toml(load_sensor("gelsight-wedge")), what="a sensor")["gelsight-wedge"]
    document |= {"raw_px": [640, 480], "corners_px": [list(corner) for corner in CORNERS], **changes}
    return parse_sensor("my-wedge", document)


def asymmetric_face() -> np.ndarray:
    """A wide face whose quarters differ, with one bright dot in the upper left."""
    face = np.full((300, 400, 3), 90.0)
    face[:150, :200, 0], face[150:, 200:, 1] = 150.0, 170.0
    y, x = np.mgrid[:300, :400]
    face += 80.0 * np.exp(-((x - 60.0) ** 2 + (y - 40.0) ** 2) / 50.0)[..., None]
    return face


def test_the_wedge_is_wider_than_high_as_its_frames() -> None:
    wedge = load_sensor("gelsight-wedge")
    upright = asymmetric_face().astype(np.uint8)
    assert gel_levels(upright, wedge).shape == (300, 400, 3)
    assert wedge.scale_of(400, 300) == pytest.approx((1 / 11, 1 / 11), rel=1e-3)
    # The dot lies left and above of the middle, 140 and 110 pixels of 1/11 mm away.
    assert wedge.face_mm([(60.0, 40.0)], 400, 300)[0] == pytest.approx((-12.68, -9.95), abs=0.02)
    for turned in (upright.transpose(1, 0, 2), np.zeros((480, 640, 3), np.uint8) + 90):
        with pytest.raises(ImageMismatchError, match="corners"):
            gel_levels(turned, wedge)


def test_a_frame_of_the_camera_is_warped_to_the_face_by_its_corners() -> None:
    sensor, face = own_wedge(), asymmetric_face()
    ends = np.array([(0, 0), (399, 0), (399, 299), (0, 299)], float)
    to_face = ProjectiveTransform.from_estimate(np.array(CORNERS), ends)  # type: ignore[no-untyped-call]
    raw = warp(face, to_face, output_shape=(480, 640), order=1, preserve_range=True, mode="edge")  # type: ignore[no-untyped-call]
    seen = face_view(np.rint(raw).astype(np.uint8), sensor)
    assert seen.shape == face.shape
    inner = np.s_[4:-4, 4:-4]
    assert np.abs(seen[inner] - face[inner]).mean() < 1.0
    assert np.unravel_index(seen.sum(axis=2).argmax(), seen.shape[:2]) == pytest.approx((40, 60), abs=2)
    assert np.array_equal(face_view(seen, sensor), seen)  # a frame of the face stays


def test_the_order_of_the_corners_turns_the_frame() -> None:
    half = own_wedge(corners_px=[list(CORNERS[number]) for number in (2, 3, 0, 1)])
    raw = np.random.default_rng(5).integers(20, 200, (480, 640, 3)).astype(np.uint8)
    upright, turned = (face_view(raw, sensor).astype(int) for sensor in (own_wedge(), half))
    assert np.abs(upright[::-1, ::-1] - turned).max() <= 1


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"corners_px": [[0, 0], [1, 1]]}, "four places"),
        ({"corners_px": [[90, 60], [600, 440], [560, 75], [50, 425]]}, "without crossing"),
        ({"corners_px": [[90, 60], [5600, 75], [600, 440], [50, 425]]}, "corners_px must lie in"),
        ({"raw_px": [400, 300]}, "must differ from raw_px"),
        ({"bits": 40}, "bits must"),
    ],
)
def test_corners_that_are_none_are_refused_in_a_sentence(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        own_wedge(**changes)


@pytest.mark.parametrize("bits", [10, 12, 14, 16])
def test_a_file_of_sixteen_bits_has_the_levels_of_its_camera_or_asks(bits: int) -> None:
    face = np.clip(asymmetric_face(), 0, 255)
    stored = np.rint(face * ((2**bits - 1) / 255.0)).astype(np.uint16)
    told = own_wedge(bits=bits)
    assert np.abs(gel_levels(stored, told) - face).max() < 0.2
    if bits in (12, 16):
        assert np.abs(gel_levels(stored, load_sensor("gelsight-wedge")) - face).max() < 0.2
    else:
        with pytest.raises(InputError, match="must tell its bits"):
            gel_levels(stored, load_sensor("gelsight-wedge"))


def in_other_light(frame: np.ndarray, gain: tuple[float, ...], gamma: float) -> np.ndarray:
    """The frame as a camera with other gains and another curve stores it."""
    stored: np.ndarray = np.clip(np.rint(255 * (frame / 255.0 * np.asarray(gain)) ** gamma), 0, 255).astype(np.uint8)
    return stored


@pytest.mark.parametrize("name", ["gelsight-mini", "9dtact"])
@pytest.mark.parametrize(
    ("gain", "gamma"),
    [
        ((0.7, 0.7, 0.7), 1.0),
        ((1.2, 1.2, 1.2), 1.0),
        ((0.8, 1.0, 1.2), 1.0),
        ((1, 1, 1), 0.8),
        ((0.85, 0.95, 1.0), 1.2),
    ],
)
def test_a_change_of_the_light_is_told_beside_a_press_and_undone(
    name: str, gain: tuple[float, ...], gamma: float
) -> None:
    sensor = load_sensor(name)
    press = random_gel_press(sensor, np.random.default_rng(771))
    frame = in_other_light(press.frame, gain, gamma)
    levels, reference, pressed = (gel_levels(part, sensor) for part in (frame, press.reference, press.frame))
    change = light_change(levels, reference)
    assert change.known
    assert change.is_small == (sensor.light == "white" and np.mean(gain) == 1.0 and gamma == 1.0)
    lit = (levels < 245).all(axis=2)
    pressed_change = np.abs(pressed - reference)[lit].mean()
    before, after = (np.abs(part - pressed)[lit].mean() for part in (levels, change.undone(levels)))
    assert after < 0.12 * before + 0.5
    assert after < 0.25 * pressed_change + 1.0


@pytest.mark.parametrize("seed", range(820, 826))
def test_a_press_in_the_same_light_is_no_change_of_the_light(seed: int) -> None:
    sensor = load_sensor("gelsight-mini" if seed % 2 else "9dtact")
    press = random_gel_press(sensor, np.random.default_rng(seed))
    levels, reference = (gel_levels(part, sensor) for part in (press.frame, press.reference))
    change = light_change(levels, reference)
    assert change.gain == pytest.approx(1.0, abs=0.05)  # the lamps drift by 1 %
    assert change.gamma == pytest.approx(1.0, abs=0.06)


def test_a_frame_without_an_untouched_part_does_not_tell_the_light() -> None:
    assert not light_change(np.full((60, 80, 1), 255.0), np.full((60, 80, 1), 100.0)).known
