"""Harvesters with a real GenTL producer: the one that comes with the wheel of GenApi.

Its cameras play games on a small screen. They tell no time and number their frames.
"""

from __future__ import annotations

import importlib.util
import os
import signal
import threading
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.system.growth import growth_over
from tests.waiting import HANGS_S

from tsis.errors import CameraError, InputError, UnknownNameError
from tsis.instrument.camera import Mode
from tsis.instrument.discovery import connect, find_cameras
from tsis.instrument.drivers.harvesters import HarvestersCamera, find_cameras_here

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tsis.instrument.drivers.genicam import GenICamCamera

pytestmark = pytest.mark.system

RED, GREEN = "VikyTL_DEV_red", "VikyTL_DEV_green"


@pytest.fixture
def producer(monkeypatch: pytest.MonkeyPatch) -> Path:
    """The producer, alone in the environment variable of the GenTL standard."""
    spec = importlib.util.find_spec("genicam")
    file = Path(spec.origin).with_name("viky.cti") if spec is not None and spec.origin else None
    if file is None or not file.is_file() or importlib.util.find_spec("harvesters") is None:
        pytest.skip("the extra camera-genicam with the GenTL producer viky.cti is not installed")
    monkeypatch.setenv("GENICAM_GENTL64_PATH", str(file.parent))
    return file


@pytest.fixture
def camera(producer: Path) -> Iterator[GenICamCamera]:
    """The red game, open."""
    opened = HarvestersCamera(RED)
    opened.open()
    yield opened
    opened.stop()


def taken(camera: GenICamCamera, count: int) -> list[Any]:
    frames = camera.frames()
    return [next(frames) for _ in range(count)]


HELD = 6  # the producer states 10 MB a frame, of which the buffers hold six
MOST_RUNS = 10


def frames_of_a_run(camera: GenICamCamera, mode: Mode) -> list[Any]:
    """Thirty frames; a machine that stops for longer than the buffers last loses some, and their numbers say so."""
    camera.open()
    camera.start(mode)
    frames = taken(camera, 30)
    camera.stop()
    assert [frame.sequence for frame in frames[:HELD]] == list(range(HELD))
    assert all(earlier.sequence < later.sequence for earlier, later in pairwise(frames))
    return frames


def test_the_cameras_of_a_producer_are_found_and_reached(producer: Path) -> None:
    findings = find_cameras(["genicam"])
    assert findings.missing == {}
    assert [(one.identity, one.model, one.note) for one in findings.cameras] == [
        (RED, "Viky", "viky.cti"),
        (GREEN, "Viky", "viky.cti"),
        ("VikyTL_DEV_blue", "Viky", "viky.cti"),
    ]
    by_serial_number = connect("genicam:1")
    by_serial_number.open()
    assert by_serial_number.name == f"genicam camera {GREEN}"
    by_serial_number.stop()


def test_frames_arrive_without_gaps_in_the_mode_asked_for(camera: GenICamCamera) -> None:
    default = Mode(width_px=400, height_px=400, frames_per_s=20.0, pixel_format="Mono8")
    assert camera.modes()[0] == default
    runs = (
        frames_of_a_run(camera, Mode(width_px=200, height_px=120, frames_per_s=50.0, pixel_format="Mono8"))
        for _ in range(MOST_RUNS)
    )
    frames = next(frames for frames in runs if frames[-1].sequence == len(frames) - 1)
    assert {frame.pixels.shape for frame in frames} == {(120, 200)}
    assert {frame.pixels.dtype for frame in frames} == {np.dtype(np.uint8)}
    assert all(earlier.time_s < later.time_s for earlier, later in pairwise(frames))
    assert any((frame.pixels != frames[0].pixels).any() for frame in frames)  # the game goes on
    assert 0 < np.mean([frame.pixels.mean() for frame in frames]) < 255


def test_the_rate_is_what_it_was_set_to(camera: GenICamCamera) -> None:
    camera.adjust("frames_per_s", 50.0)
    camera.start()
    frames = taken(camera, 26)
    assert frames[0].settings == {"frames_per_s": 50.0}
    assert 0.9 / 50 < np.median(np.diff([frame.time_s for frame in frames])) < 1 / 20  # it began with 20 a second


def test_what_the_camera_has_not_is_said_in_one_sentence(camera: GenICamCamera) -> None:
    with pytest.raises(UnknownNameError, match="no setting is called 'gain'"):
        camera.adjust("gain", 1.0)
    with pytest.raises(InputError, match=r"frames_per_s must lie in \[1, 200\]; got 1000"):
        camera.adjust("frames_per_s", 1000.0)
    with pytest.raises(CameraError, match=r"has no mode Mono12-400x400 of full scale 4095; it offers Mono8"):
        camera.start(Mode(width_px=400, height_px=400, full_scale=4095.0, pixel_format="Mono12"))


def test_a_camera_in_use_is_busy_and_its_neighbour_is_not(camera: GenICamCamera) -> None:
    source: Any = type(camera)
    with pytest.raises(CameraError, match=f"camera {RED} is busy"):
        source(RED).open()
    neighbour = source(GREEN)
    neighbour.open()
    neighbour.start()
    camera.start()
    assert taken(neighbour, 2)[1].sequence == taken(camera, 2)[1].sequence == 1
    neighbour.stop()
    assert taken(camera, 1)
    with pytest.raises(CameraError, match=rf"is called 'nobody'; found: .*{RED}"):
        source("nobody").open()


def test_stop_releases_a_waiting_reader_and_the_camera_opens_again(camera: GenICamCamera) -> None:
    camera.adjust("frames_per_s", 1.0)
    camera.start()
    reading = threading.Event()
    numbers: list[int] = []

    def read() -> None:
        for frame in camera.frames():
            reading.set()
            numbers.append(frame.sequence)

    reader = threading.Thread(target=read)
    reader.start()
    assert reading.wait(HANGS_S)
    camera.stop()
    reader.join(HANGS_S)
    assert not reader.is_alive()
    assert len(numbers) == 1  # the next frame comes a second later: the reader did not wait for it
    camera.open()
    camera.start(camera.modes()[0])
    assert taken(camera, 2)[1].sequence == 1


def test_a_search_does_not_disturb_a_running_camera(producer: Path) -> None:
    camera = HarvestersCamera(RED)
    camera.open()
    camera.start()
    frames = camera.frames()
    next(frames)
    assert RED in {one.identity for one in find_cameras_here()}
    assert next(frames).sequence == 1
    camera.stop()


def test_the_programs_own_answer_to_an_interrupt_stays(producer: Path) -> None:
    before = signal.getsignal(signal.SIGINT)
    camera = HarvestersCamera(RED)
    camera.open()
    assert signal.getsignal(signal.SIGINT) is before
    camera.stop()


def test_no_producer_and_a_broken_one(producer: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "broken.cti").write_bytes(b"no library at all")
    monkeypatch.setenv("GENICAM_GENTL64_PATH", str(tmp_path))
    with pytest.raises(CameraError, match=r"the GenTL producer 'broken\.cti' cannot be loaded: "):
        HarvestersCamera().open()
    assert "'broken.cti' cannot be loaded" in find_cameras(["genicam"]).missing["genicam"]
    monkeypatch.setenv("GENICAM_GENTL64_PATH", os.pathsep.join([str(tmp_path), str(producer.parent)]))
    assert len(find_cameras_here()) == 3  # the broken one is passed over
    camera = HarvestersCamera(GREEN)
    camera.open()
    camera.stop()
    monkeypatch.setenv("GENICAM_GENTL64_PATH", str(tmp_path / "absent"))
    with pytest.raises(CameraError, match=r"needs a GenTL producer .* and found none"):
        HarvestersCamera().open()
    assert "GENICAM_GENTL64_PATH" in find_cameras(["genicam"]).missing["genicam"]


@pytest.mark.slow
def test_nothing_is_kept_over_reconnections(camera: GenICamCamera) -> None:
    def reconnect() -> None:
        camera.open()
        camera.start(Mode(width_px=200, height_px=120, frames_per_s=200.0, pixel_format="Mono8"))
        taken(camera, 3)
        camera.stop()  # or the buffers in use, as many as came, would be counted

    growth = growth_over(100, reconnect, warm_up=100)
    assert growth.descriptors == 0
    assert growth.threads == 0
    assert growth.resident_bytes < 5_000_000
