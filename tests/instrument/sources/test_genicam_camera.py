from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from tests.instrument.sources.genicam_stand_ins import Clock, DriverError, FakeLink, links, torn, whole
from tests.waiting import HANGS_S

from tsis.errors import CameraError
from tsis.instrument.camera import Camera, Frame
from tsis.instrument.drivers.genicam import GenICamCamera

Run = Callable[[FakeLink], GenICamCamera]


@pytest.fixture
def made() -> Iterator[list[GenICamCamera]]:
    """Cameras that are let go of after the test."""
    cameras: list[GenICamCamera] = []
    yield cameras
    for camera in cameras:
        camera.stop()


@pytest.fixture
def running(made: list[GenICamCamera]) -> Run:
    """Starts a camera behind a link."""

    def start(link: FakeLink) -> GenICamCamera:
        camera = GenICamCamera("bench", "", link=links(link), clock=link.clock)
        made.append(camera)
        camera.open()
        camera.start()
        return camera

    return start


def read_until_lost(camera: Camera) -> tuple[list[Frame], str]:
    frames: list[Frame] = []
    try:
        frames.extend(iter_into(camera, frames))
    except CameraError as error:
        return frames, str(error)
    return frames, ""


def iter_into(camera: Camera, frames: list[Frame]) -> list[Frame]:
    for frame in camera.frames():
        frames.append(frame)  # noqa: PERF402 - those before an error are kept
    return []


def test_it_follows_the_protocol_and_is_named_after_the_camera_that_was_found(running: Run) -> None:
    camera = running(FakeLink())
    assert isinstance(camera, Camera)
    assert camera.name == "bench camera K1"


def test_lost_and_torn_frames_leave_gaps_and_are_never_delivered(running: Run) -> None:
    link = FakeLink([torn(7), whole(8), torn(9), whole(10), torn(), whole(14)])
    camera = running(link)
    frames, _ = read_until_lost(camera)
    assert [frame.sequence for frame in frames] == [1, 3, 7]
    assert [int(frame.pixels[0, 0]) for frame in frames] == [8, 10, 14]
    assert frames[0].name == "bench camera K1#1"


def test_times_are_the_cameras_own_and_the_clocks_where_it_has_none(running: Run) -> None:
    camera = running(FakeLink([whole(0, 50.25), whole(1, 50.5), whole(2, 51.0)]))
    frames, _ = read_until_lost(camera)
    assert [frame.time_s for frame in frames] == [0.0, 0.25, 0.75]
    camera.stop()
    camera = running(FakeLink([whole(0), None, None, whole(1)]))
    frames, _ = read_until_lost(camera)
    assert [frame.time_s for frame in frames] == pytest.approx([0.0, 0.2])


def test_silence_of_one_second_is_a_loss(running: Run) -> None:
    clock = Clock()
    camera = running(FakeLink([whole(0), whole(1)], clock=clock))
    begun_s = clock.now_s
    frames, sentence = read_until_lost(camera)
    assert len(frames) == 2
    assert camera.lost
    assert clock.now_s - begun_s == pytest.approx(1.0, abs=0.11)
    assert sentence.startswith("bench camera K1 was lost: no frame came for 1.")
    assert sentence.endswith(" s; check its cable and power, and open it again")


def test_torn_frames_are_a_sign_of_life_and_so_is_a_reader_who_takes_his_time(running: Run) -> None:
    clock = Clock()
    script = [whole(0)] + 9 * [None] + [torn(1)] + 9 * [None] + [whole(2), whole(3)]
    camera = running(FakeLink(script, clock=clock))
    seen = []
    for frame in camera.frames():
        seen.append(frame.sequence)
        clock.now_s += 30.0
        if len(seen) == 3:
            break
    assert seen == [0, 2, 3]
    assert not camera.lost


def test_a_slow_camera_is_waited_for(running: Run) -> None:
    clock = Clock()
    link = FakeLink([whole(0)] + 45 * [None] + [whole(1)], clock=clock)
    camera = running(link)
    camera.adjust("exposure_ms", 1000.0)
    camera.adjust("frames_per_s", 1.0)
    frames = camera.frames()
    next(frames)
    with pytest.raises(CameraError, match=r"no frame came for 3\.\d s"):
        next(frames)


@pytest.mark.parametrize("script", [[whole(0), DriverError("Device has been removed. : X (file 'a')")], [whole(0)]])
def test_a_removed_camera_is_lost_at_once(script: list[Any], running: Run) -> None:
    clock = Clock()
    link = FakeLink(script, clock=clock)
    camera = running(link)
    frames = camera.frames()
    first = next(frames)
    link.present = len(script) == 2
    with pytest.raises(CameraError, match=r"was lost: (it was removed|reading it failed: Device has been removed);"):
        next(frames)
    assert camera.lost
    assert clock.now_s == 100.0
    assert int(first.pixels.sum()) == 0  # what was read stays


def test_a_lost_camera_is_opened_anew_with_a_new_handle(made: list[GenICamCamera]) -> None:
    clock = Clock()
    first, second = FakeLink([whole(5)], clock=clock), FakeLink([whole(900), whole(902)], clock=clock)
    camera = GenICamCamera("bench", "K1", link=links(first, second), clock=clock)
    made.append(camera)
    camera.open()
    camera.start()
    read_until_lost(camera)
    camera.open()
    assert not camera.lost
    assert first.calls == ["begin", "end", "close"]
    camera.start()
    frames, _ = read_until_lost(camera)
    assert [frame.sequence for frame in frames] == [0, 2]
    camera.stop()
    camera.stop()
    assert second.calls == ["begin", "end", "close"]


def test_settings_travel_with_the_frames(running: Run) -> None:
    link = FakeLink([whole(0), whole(1)])
    camera = running(link)
    frames = camera.frames()
    assert next(frames).settings == {"exposure_ms": 20.0, "gain": 3.0, "brightness": 10.0, "frames_per_s": 30.0}
    camera.adjust("gain", 6)
    assert next(frames).settings["gain"] == 6.0
    assert {setting.name: setting.value for setting in camera.settings()}["gain"] == 6.0


def test_frames_carry_the_range_of_their_mode(made: list[GenICamCamera]) -> None:
    link = FakeLink([whole(0)])
    camera = GenICamCamera("bench", "", link=links(link), clock=link.clock)
    made.append(camera)
    camera.open()
    camera.start(camera.modes()[1])
    assert next(camera.frames()).full_scale == 4095.0


def test_stopping_releases_a_reader_of_another_thread(running: Run) -> None:
    waiting, stopped = threading.Event(), threading.Event()

    def hold() -> None:
        waiting.set()
        assert stopped.wait(HANGS_S)

    link = FakeLink([whole(0), hold, DriverError("the device was closed")])
    camera = running(link)
    ends: list[str] = []
    reader = threading.Thread(target=lambda: ends.append(read_until_lost(camera)[1]))
    reader.start()
    assert waiting.wait(HANGS_S)
    stopper = threading.Thread(target=camera.stop)
    stopper.start()
    stopped.set()
    stopper.join(HANGS_S)
    reader.join(HANGS_S)
    assert ends == [""]
    assert not camera.lost
    assert link.calls == ["begin", "end", "close"]


def test_a_camera_that_this_program_holds_is_busy_until_it_is_let_go(running: Run, made: list[GenICamCamera]) -> None:
    camera = running(FakeLink())
    second = FakeLink()
    other = GenICamCamera("bench", "K1", link=links(second, FakeLink()))
    made.append(other)
    with pytest.raises(CameraError, match=r"bench camera K1 is busy: this program holds it already"):
        other.open()
    assert second.calls == ["close"]
    camera.stop()
    other.open()
    other.stop()


def test_the_order_of_calls_is_checked_and_drivers_speak_in_sentences(made: list[GenICamCamera]) -> None:
    link = FakeLink()
    camera = GenICamCamera("bench", "K1", link=links(link))
    made.append(camera)
    for call in (camera.modes, camera.settings, camera.start):
        with pytest.raises(CameraError, match=r"bench camera K1 must be opened first; call open\(\)"):
            call()
    camera.open()
    with pytest.raises(CameraError, match=r"call start\(\)"):
        next(camera.frames())
    link.nodes.options["ExposureAuto"] = ("Once", "Continuous")  # cannot be switched off
    with pytest.raises(CameraError, match=r"^bench camera K1 does not take exposure_ms = 5: Node is not writable$"):
        camera.adjust("exposure_ms", 5)
    camera.start()
    with pytest.raises(CameraError, match="is running already"):
        camera.start()
