"""The fake camera of Aravis: frames, lost packets, lost cameras, cameras in use."""

from __future__ import annotations

import ctypes
import gc
import itertools
import os
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.system.aravis_peer import LOOPBACK, fake_camera, loopback_camera_port, standing_clock
from tests.waiting import HANGS_S

from tsis.errors import CameraError, InputError, UnknownNameError
from tsis.instrument.camera import Mode
from tsis.instrument.discovery import find_cameras
from tsis.instrument.drivers.aravis import AravisCamera

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from tsis.instrument.camera import Frame

pytestmark = pytest.mark.system


@pytest.fixture(scope="module", autouse=True)
def port() -> Iterator[None]:
    with loopback_camera_port():
        yield


def _started(
    rate: float = 25.0, *, clock: Callable[[], float] = standing_clock
) -> tuple[AravisCamera, Iterator[Frame]]:
    camera = AravisCamera(LOOPBACK, clock=clock)
    camera.open()
    camera.adjust("frames_per_s", rate)
    camera.start()
    return camera, camera.frames()


def _lost(camera: AravisCamera) -> bool:
    return camera.lost


def _content_number(frame: Frame) -> int:
    """Number, modulo 255, that the fake camera draws into its ramp; every pixel must agree on it."""
    rows, columns = np.indices(frame.pixels.shape)
    number = int(frame.pixels[0, 0])
    np.testing.assert_array_equal(frame.pixels, (rows + columns + number) % 255)
    return number


def test_frames_sequence_time_and_settings() -> None:
    with fake_camera("TSISA"):
        camera, frames = _started(50.0)
        kept = list(itertools.islice(frames, 25))
        camera.stop()
    assert [frame.sequence for frame in kept] == list(range(25))
    numbers = [_content_number(frame) for frame in kept]
    assert [(number - numbers[0]) % 255 for number in numbers] == list(range(25))
    times = np.array([frame.time_s for frame in kept])
    assert times[0] == 0.0
    assert np.diff(times).min() > 0
    np.testing.assert_allclose(times[-1], 24 / 50, rtol=0.2)
    assert kept[0].settings == {"exposure_ms": 10.0, "gain": 0.0, "frames_per_s": pytest.approx(50.0)}
    assert kept[0].pixels.dtype == np.uint8


def test_a_search_names_it_and_an_unknown_name_says_what_was_found() -> None:
    with fake_camera("TSISB"):
        listing = find_cameras()  # as the command line and the console search
        (camera,) = (camera for camera in listing.cameras if camera.identity == "Aravis-Fake-TSISB")
        assert (camera.spec, camera.maker, camera.model) == ("aravis:Aravis-Fake-TSISB", "Aravis", "Fake")
        assert LOOPBACK in camera.note
        named = AravisCamera(camera.identity, clock=standing_clock)
        named.open()
        named.start()
        # Aravis hears the fake over every network of this machine; frames come only where it is opened by its address
        assert _content_number(next(named.frames())) >= 0
        named.stop()
        with pytest.raises(CameraError, match=r"'Aravis-Fake-NONE' answers.*found: .*Aravis-Fake-TSISB"):
            AravisCamera("Aravis-Fake-NONE").open()


def test_modes_settings_and_a_camera_that_is_held(monkeypatch: pytest.MonkeyPatch) -> None:
    # the fake camera is free again when this process stops for its three seconds, so the wait ends long before
    monkeypatch.setattr("tsis.instrument.drivers.aravis.HELD_S", 0.3)
    with fake_camera("TSISC"):
        camera = AravisCamera(LOOPBACK, clock=standing_clock)
        camera.open()
        labels = [mode.label for mode in camera.modes()]
        assert labels == ["Mono8-512x512@25", "Mono8-2048x2048@25", "Mono16-512x512@25", "Mono16-2048x2048@25"]
        assert [mode.full_scale for mode in camera.modes()] == [255.0, 255.0, 65535.0, 65535.0]
        with pytest.raises(CameraError, match="has no mode Mono8-640x480; it has Mono8-512x512@25"):
            camera.start(Mode(width_px=640, height_px=480, pixel_format="Mono8"))
        with pytest.raises(InputError, match=r"exposure_ms must lie in \[0.01, 10000\]; got 1e\+06 \(ms\)"):
            camera.adjust("exposure_ms", 1e6)
        with pytest.raises(UnknownNameError, match="did you mean 'exposure_ms'"):
            camera.adjust("exposure", 1.0)
        camera.adjust("gain", 3)
        assert {setting.name: setting.value for setting in camera.settings()}["gain"] == 3.0
        with pytest.raises(CameraError, match=r"127\.0\.0\.1 is held by another program; close it there"):
            AravisCamera(LOOPBACK).open()
        camera.start(camera.modes()[2])
        frame = next(camera.frames())
        assert (frame.pixels.shape, frame.pixels.dtype, frame.full_scale) == ((512, 512), np.dtype("<u2"), 65535.0)
        camera.stop()
        camera.stop()
        with pytest.raises(CameraError, match=r"call open\(\)"):
            camera.modes()


@pytest.mark.parametrize("per_thousand", [1, 20])
def test_frames_with_lost_packets_leave_gaps_and_are_never_delivered(per_thousand: int) -> None:
    with fake_camera("TSISD", "-r", str(per_thousand)):
        camera, frames = _started(100.0)
        kept = list(itertools.islice(frames, 60 if per_thousand == 1 else 5))
        camera.stop()
    steps = np.diff([frame.sequence for frame in kept])
    numbers = [_content_number(frame) for frame in kept]
    np.testing.assert_array_equal(steps % 255, np.diff(numbers) % 255)  # received and lost make all that were sent
    assert steps.max() > 1


def test_stop_from_another_thread_ends_the_frames() -> None:
    with fake_camera("TSISE"):
        camera, frames = _started(0.5)
        left = threading.Event()

        def read() -> None:
            for _ in frames:
                pass
            left.set()

        reader = threading.Thread(target=read)
        reader.start()
        camera.stop()
        assert left.wait(HANGS_S)
        reader.join()
        assert not camera.lost


def test_a_killed_camera_is_lost_and_a_new_handle_delivers_again() -> None:
    ticks = itertools.count()  # a clock that advances by a twentieth of a second whenever it is looked at
    for _ in range(3):
        silent_s = _killed_and_opened_again(lambda: 0.05 * next(ticks))
        assert 1.0 <= silent_s <= 2.0


def _killed_and_opened_again(clock: Callable[[], float]) -> float:
    """Seconds on the camera's clock until it said that the camera was lost."""
    with fake_camera("TSISF") as process:
        camera, frames = _started(50.0, clock=clock)
        kept = list(itertools.islice(frames, 5))
        process.kill()
        process.wait()
        begun = clock()
        with pytest.raises(CameraError, match=r"lost after \d+ frames: nothing came for 1 s; check its cable"):
            kept.extend(frames)
        silent = clock() - begun
    assert camera.lost is True
    numbers = [_content_number(frame) for frame in kept]
    assert [(number - numbers[0]) % 255 for number in numbers] == list(range(len(kept)))
    with fake_camera("TSISF"):
        camera.open()
        camera.start()
        assert _lost(camera) is False
        assert _content_number(next(camera.frames())) >= 0
        camera.stop()
    return silent


@pytest.mark.slow
def test_fifty_reconnections_leak_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    # the first ten fill the caches of the allocator and of the libraries
    silent = [_killed_and_opened_again(time.monotonic) for _ in range(10)]
    _settle()
    before = _resources()
    silent += [_killed_and_opened_again(time.monotonic) for _ in range(40)]
    _settle()
    grown = _grown(before)
    _say(capsys, f"{len(silent)} of 50 reconnected, lost after {max(silent):.2f} s at most; in the last 40 {grown}")
    assert len(silent) == 50
    assert grown.megabytes < 5
    assert (grown.descriptors, grown.threads) == (0, 0)


@pytest.mark.slow
def test_twenty_thousand_frames_leak_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    with fake_camera("TSISG"):
        camera, frames = _started(400.0)
        next(itertools.islice(frames, 1_999, None))
        before = _resources()
        last = next(itertools.islice(frames, 17_999, None))
        grown = _grown(before)
        camera.stop()
    lost = last.sequence + 1 - 20_000
    _say(capsys, f"{lost} lost of {last.sequence + 1} frames; in the last 18,000 {grown}")
    assert grown.megabytes < 5
    assert (grown.descriptors, grown.threads) == (0, 0)


@dataclass(frozen=True)
class Resources:
    megabytes: float
    descriptors: int
    threads: int

    def __str__(self) -> str:
        return f"{self.megabytes:.1f} MB, {self.descriptors} descriptors and {self.threads} threads more"


def _resources() -> Resources:
    gc.collect()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # what the allocator of glibc keeps free is not in use
    if trim is not None:
        trim(0)
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    descriptors, threads = (len(list(Path(f"/proc/self/{what}").iterdir())) for what in ("fd", "task"))
    return Resources(pages * os.sysconf("SC_PAGE_SIZE") / 1e6, descriptors, threads)


def _grown(before: Resources) -> Resources:
    now = _resources()
    return Resources(
        now.megabytes - before.megabytes, now.descriptors - before.descriptors, now.threads - before.threads
    )


def _say(capsys: pytest.CaptureFixture[str], sentence: str) -> None:
    with capsys.disabled():
        sys.stdout.write(f"\n{sentence}\n")


def _settle() -> None:
    """Wait for what lets go of lost cameras."""
    for thread in threading.enumerate():
        if thread.name.startswith("leaving "):
            thread.join(HANGS_S)
