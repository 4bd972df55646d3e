"""Basler's own camera emulator, through its own library."""

from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest
from tests.system.growth import growth_over
from tests.waiting import HANGS_S

from tsis.errors import CameraError, InputError
from tsis.instrument.camera import Mode
from tsis.instrument.discovery import connect, find_cameras
from tsis.instrument.drivers.genicam import maker_library
from tsis.instrument.drivers.pylon import PylonCamera, find_cameras_here, missing_requirement

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

pytestmark = [
    pytest.mark.system,
    pytest.mark.skipif(missing_requirement() is not None, reason=str(missing_requirement())),
]

SIZE = Mode(width_px=768, height_px=492, frames_per_s=100.0, pixel_format="Mono8")


@pytest.fixture
def camera(monkeypatch: pytest.MonkeyPatch) -> Iterator[PylonCamera]:
    """The first of two emulated cameras, open."""
    monkeypatch.setenv("PYLON_CAMEMU", "2")
    opened = PylonCamera()
    opened.open()
    yield opened
    opened.stop()


def features(camera: PylonCamera) -> Any:
    """The emulator's own features, by which it is told to fail."""
    return camera._link._camera.GetNodeMap()  # type: ignore[union-attr]


def taken(camera: PylonCamera, count: int) -> list[Any]:
    frames = camera.frames()
    return [next(frames) for _ in range(count)]


def test_emulated_cameras_are_found_and_reached_by_their_number(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYLON_CAMEMU", "2")
    findings = find_cameras(["pylon"])
    assert findings.missing == {}
    assert [camera.maker for camera in findings.cameras] == ["Basler", "Basler"]
    second = connect(findings.cameras[1].spec)
    second.open()
    assert second.name == f"pylon camera {findings.cameras[1].identity}"
    second.stop()
    monkeypatch.setenv("PYLON_CAMEMU", "0")
    assert all(camera.model != "Emulation" for camera in find_cameras_here())
    with pytest.raises(CameraError, match="no pylon camera is called 'nobody'"):
        connect("pylon:nobody").open()


def test_a_folder_of_images_arrives_bit_for_bit_and_in_order(camera: PylonCamera, tmp_path: Path) -> None:
    rng = np.random.default_rng(7)
    pictures = rng.integers(0, 256, (5, 492, 768), dtype=np.uint8)
    for number, picture in enumerate(pictures):
        cv2.imwrite(str(tmp_path / f"{number}.png"), picture)
    nodes = features(camera)
    nodes.GetNode("TestImageSelector").SetValue("Off")
    nodes.GetNode("ImageFilename").SetValue(str(tmp_path))
    nodes.GetNode("ImageFileMode").SetValue("On")
    camera.start(SIZE)
    frames = taken(camera, 10)
    assert [frame.sequence for frame in frames] == list(range(10))
    for frame in frames:
        np.testing.assert_array_equal(frame.pixels, pictures[frame.sequence % 5])


@pytest.mark.parametrize(("pixel_format", "full_scale"), [("Mono8", 255.0), ("Mono10", 1023.0), ("Mono12", 4095.0)])
def test_grey_formats_arrive_in_their_range(camera: PylonCamera, pixel_format: str, full_scale: float) -> None:
    camera.start(Mode(width_px=256, height_px=64, full_scale=full_scale, pixel_format=pixel_format))
    (frame,) = taken(camera, 1)
    assert frame.pixels.shape == (64, 256)
    assert frame.pixels.dtype == (np.uint8 if full_scale == 255 else np.uint16)
    assert 0.9 * full_scale < frame.pixels.max() <= frame.full_scale == full_scale


def test_buffers_that_fail_are_gaps(camera: PylonCamera) -> None:
    camera.start(SIZE)
    frames = camera.frames()
    next(frames)
    nodes = features(camera)
    nodes.GetNode("ForceFailedBufferCount").SetValue(7)
    nodes.GetNode("ForceFailedBuffer").Execute()
    sequence = [next(frames).sequence for _ in range(40)]
    steps = np.diff([0, *sequence])
    assert max(steps) == 8
    assert sequence[-1] - len(sequence) == 7  # counted and received make up what was sent


def test_settings_reach_the_camera_and_the_frames(camera: PylonCamera) -> None:
    camera.adjust("gain", 6.0)
    camera.adjust("exposure_ms", 3.5)
    camera.start(SIZE)
    nodes = features(camera)
    assert nodes.GetNode("ExposureTime").GetValue() == 3500.0
    assert nodes.GetNode("AcquisitionFrameRate").GetValue() == 100.0
    (frame,) = taken(camera, 1)
    assert frame.settings["exposure_ms"] == 3.5
    assert frame.settings["gain"] == pytest.approx(6.0, abs=0.01)
    with pytest.raises(InputError, match=r"gain must lie in \[0, 48\]; got 500 \(dB\)"):
        camera.adjust("gain", 500.0)
    with pytest.raises(CameraError, match="is running already"):
        camera.start(SIZE)


def test_a_camera_in_use_is_busy(camera: PylonCamera) -> None:
    with pytest.raises(CameraError, match="is busy"):
        PylonCamera(camera.name.split()[-1]).open()


def test_a_removed_camera_is_lost_and_comes_back_with_a_new_handle(camera: PylonCamera) -> None:
    for _ in range(3):
        camera.start(SIZE)
        frames = camera.frames()
        kept = next(frames)
        nodes = features(camera)
        nodes.GetNode("FirePnPCallbackValue").SetValue(1)
        nodes.GetNode("FirePnPCallback").Execute()
        with pytest.raises(CameraError, match="was lost: it was removed"):
            list(frames)
        assert camera.lost
        assert kept.pixels.max() > 0
        camera.open()
        assert not camera.lost


def test_stop_releases_a_waiting_reader(camera: PylonCamera) -> None:
    camera.adjust("frames_per_s", 1.0)
    camera.start(Mode(width_px=768, height_px=492, pixel_format="Mono8"))
    reading, ended_s = threading.Event(), []

    def read() -> None:
        for _ in camera.frames():
            reading.set()
        ended_s.append(time.monotonic())

    reader = threading.Thread(target=read)
    reader.start()
    assert reading.wait(HANGS_S)
    stopped_s = time.monotonic()
    camera.stop()
    reader.join(HANGS_S)
    assert ended_s
    assert ended_s[0] - stopped_s < 0.3


@pytest.mark.slow
def test_nothing_is_kept_over_reconnections_but_what_the_library_keeps(camera: PylonCamera) -> None:
    """The library grows with each camera that it opens, so the same is done without tsis and compared."""
    library = maker_library("pypylon.pylon", source="pylon")
    camera.stop()

    def bare() -> None:
        factory = library.TlFactory.GetInstance()
        device = library.InstantCamera(factory.CreateDevice(factory.EnumerateDevices()[0]))
        device.Open()
        device.Close()
        device.DestroyDevice()

    def reconnect() -> None:
        camera.open()
        camera.start(SIZE)
        taken(camera, 3)
        camera.stop()  # or the buffers in use, as many as came, would be counted

    ours = growth_over(100, reconnect, warm_up=100)
    theirs = growth_over(100, bare, warm_up=100)
    assert ours.resident_bytes - theirs.resident_bytes < 2_500_000
    assert ours.descriptors == ours.threads == 0
