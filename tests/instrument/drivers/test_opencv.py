from __future__ import annotations

from itertools import count
from typing import Any

import cv2
import numpy as np
import pytest

from tsis.errors import CameraError, InputError, UnknownNameError
from tsis.instrument.camera import Mode
from tsis.instrument.drivers.opencv import OpenCVDevice


class FakeCapture:
    """Answers like ``cv2.VideoCapture`` on a camera that is unplugged after ``frames`` frames."""

    def __init__(self, frames: int) -> None:
        self.left, self.released = frames, False
        self.properties: dict[int, float] = {
            cv2.CAP_PROP_FRAME_WIDTH: 8,
            cv2.CAP_PROP_FRAME_HEIGHT: 6,
            cv2.CAP_PROP_FPS: 30.0,
            cv2.CAP_PROP_BRIGHTNESS: 0.5,
            cv2.CAP_PROP_GAIN: -1.0,
            cv2.CAP_PROP_EXPOSURE: 100.0,
        }
        self.frozen = {cv2.CAP_PROP_EXPOSURE, cv2.CAP_PROP_FRAME_WIDTH}

    def isOpened(self) -> bool:  # noqa: N802 - OpenCV's name
        return True

    def get(self, number: int) -> float:
        return self.properties[number]

    def set(self, number: int, value: float) -> bool:
        if number in self.frozen:
            return False
        self.properties[number] = value
        return True

    def read(self) -> tuple[bool, Any]:
        if self.left == 0:
            return False, None
        self.left -= 1
        return True, np.dstack([np.full((6, 8), level, np.uint8) for level in (10, 20, 30)])  # blue, green, red

    def release(self) -> None:
        self.released = True


def _device(frames: int = 3) -> tuple[OpenCVDevice, FakeCapture]:
    fake, ticks = FakeCapture(frames), count(100.0, 0.5)
    device = OpenCVDevice(0, capture=lambda _: fake, clock=lambda: next(ticks))
    device.open()
    return device, fake


def test_an_absent_camera_is_one_sentence(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(CameraError, match="no camera answers at index 99; check its cable") as caught:
        OpenCVDevice(99).open()
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("index", [-1, 10_000, float("nan"), "0", True])
def test_an_impossible_index_is_refused(index: Any) -> None:
    with pytest.raises(InputError, match="index must"):
        OpenCVDevice(index)


def test_frames_until_the_camera_is_lost() -> None:
    device, _ = _device(frames=3)
    device.start()
    stream = device.frames()
    frames = [next(stream) for _ in range(3)]
    with pytest.raises(CameraError, match="camera 0 was lost after 3 frames"):
        next(stream)
    assert device.lost
    assert [frame.sequence for frame in frames] == [0, 1, 2]
    assert [frame.time_s for frame in frames] == [0.0, 0.5, 1.0]
    assert frames[0].settings == {"brightness": 0.5, "exposure": 100.0}
    np.testing.assert_array_equal(frames[0].pixels, round(0.2126 * 30 + 0.7152 * 20 + 0.0722 * 10))
    assert frames[0].colour is not None
    np.testing.assert_array_equal(frames[0].colour, np.full((6, 8, 3), (30, 20, 10)))  # red, green, blue


def test_opening_again_builds_a_new_handle() -> None:
    handles: list[FakeCapture] = []

    def opened(_: int) -> FakeCapture:
        handles.append(FakeCapture(1))
        return handles[-1]

    device = OpenCVDevice(0, capture=opened)
    for _ in range(2):
        device.open()
        device.start()
        with pytest.raises(CameraError, match="lost after 1 frames"):
            list(device.frames())
    assert [handle.released for handle in handles] == [True, False]


def test_settings_are_those_the_driver_has() -> None:
    device, fake = _device()
    assert [setting.name for setting in device.settings()] == ["brightness", "exposure"]
    device.adjust("brightness", 0.7)
    assert fake.properties[cv2.CAP_PROP_BRIGHTNESS] == 0.7
    with pytest.raises(CameraError, match="does not take exposure = 5"):
        device.adjust("exposure", 5.0)
    with pytest.raises(UnknownNameError, match="did you mean 'brightness'"):
        device.adjust("brigthness", 0.7)
    with pytest.raises(InputError, match="brightness must lie in"):
        device.adjust("brightness", float("nan"))


def test_a_mode_that_the_camera_does_not_take_is_an_error() -> None:
    device, _ = _device()
    assert device.modes() == (Mode(width_px=8, height_px=6, frames_per_s=30.0),)
    with pytest.raises(CameraError, match="does not take"):
        device.start(Mode(width_px=640, height_px=480))
    device.start(Mode(width_px=8, height_px=12))
    assert device.modes()[0].height_px == 12


def test_the_order_of_calls_is_checked_and_stopping_releases_the_camera() -> None:
    device, fake = _device()
    with pytest.raises(CameraError, match=r"call start\(\)"):
        next(device.frames())
    device.start()
    frames = device.frames()
    next(frames)
    device.stop()
    device.stop()
    assert list(frames) == []
    assert fake.released
    with pytest.raises(CameraError, match=r"call open\(\)"):
        device.modes()
