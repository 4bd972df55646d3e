from __future__ import annotations

from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from tsis.errors import ImageMismatchError, InputError, UnknownNameError
from tsis.instrument.camera import Camera, Frame, Mode, Setting, preset, silence_timeout_s
from tsis.instrument.drivers.files import ImageFiles, VideoFile
from tsis.instrument.drivers.opencv import OpenCVDevice


def test_every_source_follows_the_protocol() -> None:
    for source in (ImageFiles("folder"), VideoFile("clip.avi"), OpenCVDevice(0)):
        assert isinstance(source, Camera)


def test_a_frame_keeps_a_read_only_copy_of_its_own_dtype() -> None:
    pixels = np.full((3, 4), 9, np.uint8)
    frame = Frame(pixels=pixels, sequence=0)
    pixels[:] = 0
    assert frame.pixels.dtype == np.uint8
    assert frame.pixels.min() == 9
    with pytest.raises(ValueError, match="read-only"):
        frame.pixels[0, 0] = 1
    with pytest.raises(FrozenInstanceError):
        frame.sequence = 1  # type: ignore[misc]


def test_a_frame_keeps_its_colours_beside_the_grey_levels() -> None:
    colour = np.zeros((3, 4, 3), np.uint8)
    frame = Frame(pixels=np.zeros((3, 4), np.uint8), colour=colour, sequence=0)
    colour[:] = 9
    assert frame.colour is not None
    assert frame.colour.dtype == np.uint8
    assert (int(frame.colour.max()), frame.nbytes) == (0, 48)
    assert Frame(pixels=np.zeros((3, 4), np.uint8), sequence=0).nbytes == 12
    with pytest.raises(ImageMismatchError, match=r"shape \(4, 4, 3\), as the grey levels; got \(3, 4, 3\)"):
        Frame(pixels=np.zeros((4, 4)), colour=colour, sequence=0)


def test_a_frame_becomes_a_tactile_image() -> None:
    frame = Frame(pixels=np.eye(3), sequence=4, full_scale=1023.0, name="clip#4", settings={"gain": 2.0})
    image = frame.tactile_image(mm_per_pixel=(0.1, 0.2), force_n=0.7)
    np.testing.assert_array_equal(image.grey, np.eye(3))
    assert (image.full_scale, image.name, image.force_n) == (1023.0, "clip#4", 0.7)
    assert image.settings == {"gain": 2.0}


@pytest.mark.parametrize("pixels", [np.zeros((2, 2, 3)), np.zeros((0, 4)), np.array([[np.nan]])])
def test_a_frame_refuses_what_is_no_grey_picture(pixels: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> None:
    with pytest.raises(InputError, match="pixels must"):
        Frame(pixels=pixels, sequence=0)


def test_a_setting_names_its_range() -> None:
    gain = Setting(name="gain", value=0.0, low=0.0, high=24.0, unit="dB")
    with pytest.raises(InputError, match=r"gain must lie in \[0, 24\]; got 25 \(dB\)"):
        gain.checked(25.0)
    assert Setting(name="exposure", value=1.0).checked(1e9) == 1e9


def test_a_mode_refuses_impossible_sizes() -> None:
    with pytest.raises(InputError, match="width_px must lie in"):
        Mode(width_px=0, height_px=10)
    with pytest.raises(InputError, match="frames_per_s must lie in"):
        Mode(width_px=10, height_px=10, frames_per_s=0.0)


SETTINGS = (
    Setting(name="exposure_ms", value=20.0, low=0.1, high=33.0, unit="ms"),
    Setting(name="gain", value=6.0, low=0.0, high=24.0, unit="dB"),
    Setting(name="brightness", value=3.0),  # a driver that tells no range
    Setting(name="force_n", value=1.0, low=0.0, high=5.0, unit="newtons"),
)


def test_minimal_takes_the_lowest_light_that_the_driver_tells() -> None:
    assert preset("minimal", SETTINGS) == {"exposure_ms": 0.1, "gain": 0.0}


def test_default_takes_the_camera_back_to_how_it_came() -> None:
    assert preset("default", SETTINGS) == {"exposure_ms": 20.0, "gain": 6.0, "brightness": 3.0}


def test_other_presets_are_not_known() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'minimal'"):
        preset("minimum", SETTINGS)


def test_a_slow_camera_is_given_the_time_of_three_frames() -> None:
    assert silence_timeout_s({}) == 1.0
    assert silence_timeout_s({"frames_per_s": 0.25}) == 12.0
    assert silence_timeout_s({"frames_per_s": 30.0, "exposure_ms": 3000.0}) == 9.0
