"""Every frame of a camera is received once or counted as missed, through losses, stalls and a simulated day."""

from __future__ import annotations

import gc
import os
import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.endurance import scaled
from tests.instrument.scripted_camera import BREAK, END, ScriptedCamera, frame
from tests.waiting import HANGS_S, until

from tsis.errors import CameraError, ImageMismatchError, InputError, UnknownNameError
from tsis.instrument import acquisition
from tsis.instrument.acquisition import Acquisition, FrameRate, FrameRing, Intake, ReceivedFrame
from tsis.instrument.camera import Frame, Mode

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tsis.instrument.camera import Setting


def _arrival(number: int) -> ReceivedFrame:
    return ReceivedFrame(frame=frame(number), arrived_s=number / 30)


@given(capacity=st.integers(1, 8), steps=st.lists(st.integers(0, 20), max_size=8))
def test_each_frame_is_read_once_or_counted_as_skipped(capacity: int, steps: list[int]) -> None:
    ring, place, put, seen, missed = FrameRing(capacity), 0, 0, [], 0
    for step in steps:
        for _ in range(step):
            ring.put(_arrival(put))
            put += 1
        fresh, place, skipped = ring.read(place)
        missed += skipped
        assert len(fresh) <= capacity
        seen += [arrival.frame.sequence for arrival in fresh]
    assert seen == sorted(set(seen))
    assert len(seen) + missed == put == ring.end
    latest = ring.latest()
    assert latest is None if put == 0 else latest is not None and latest.frame.sequence == put - 1


def test_two_readers_follow_at_their_own_pace() -> None:
    ring = FrameRing(3)
    for number in range(2):
        ring.put(_arrival(number))
    first, quick, _ = ring.read(0)
    for number in range(2, 5):
        ring.put(_arrival(number))
    again, _, none = ring.read(quick)
    late, _, skipped = ring.read(0)
    assert [a.frame.sequence for a in first] == [0, 1]
    assert ([a.frame.sequence for a in again], none) == ([2, 3, 4], 0)
    assert ([a.frame.sequence for a in late], skipped) == ([2, 3, 4], 2)


def test_waiting_ends_with_a_frame_or_with_the_ring() -> None:
    ring = FrameRing(2)
    assert not ring.wait(0, 0.0)
    ring.put(_arrival(0))
    assert ring.wait(0, 0.0)
    ring.close()
    assert not ring.wait(1, 60.0)  # returns at once: nothing will come


@pytest.mark.parametrize("capacity", [0, -1, 1.5, 10**9])
def test_a_ring_of_no_sensible_size_is_refused(capacity: float) -> None:
    with pytest.raises(InputError, match="capacity"):
        FrameRing(capacity)  # type: ignore[arg-type]


def test_frames_of_a_patient_ring_wait_for_their_reader() -> None:
    ring = FrameRing(2, patient=True)
    assert ring.has_room()
    for number in range(2):
        ring.put(_arrival(number))
    assert not ring.wait_for_room(0.0)
    fresh, _, skipped = ring.read(0)
    assert ([arrival.frame.sequence for arrival in fresh], skipped) == ([0, 1], 0)
    assert ring.wait_for_room(60.0)  # returns at once


def test_large_frames_are_bounded_by_their_bytes() -> None:
    size = frame(0).pixels.nbytes
    ring = FrameRing(100, most_bytes=3 * size)
    for number in range(10):
        ring.put(_arrival(number))
    fresh, _, skipped = ring.read(0)
    assert ([arrival.frame.sequence for arrival in fresh], skipped) == ([7, 8, 9], 7)
    tiny = FrameRing(100, most_bytes=1)
    tiny.put(_arrival(0))
    assert tiny.latest() is not None
    patient = FrameRing(100, patient=True, most_bytes=2 * size)
    for number in range(2):
        assert patient.has_room()
        patient.put(_arrival(number))
    assert not patient.has_room()


class _Clock:
    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


@given(gaps=st.lists(st.integers(1, 5), min_size=1, max_size=40))
def test_every_number_of_the_camera_is_received_or_missed(gaps: list[int]) -> None:
    intake = Intake(FrameRing(1000))
    intake.begin(0)
    sequence = -1
    for gap in gaps:
        sequence += gap
        assert intake.take(0, frame(sequence))
    account = intake.account()
    assert (account.received, account.received + account.missed) == (len(gaps), sequence + 1)


def test_numbers_that_do_not_ascend_are_counted_apart() -> None:
    ring = FrameRing(10)
    intake = Intake(ring)
    intake.begin(0)
    for sequence in (0, 1, 1, 0, 2):
        intake.take(0, frame(sequence))
    account = intake.account()
    assert (account.received, account.disordered, account.missed) == (3, 2, 0)
    assert [arrival.frame.sequence for arrival in ring.read(0)[0]] == [0, 1, 2]


def test_a_connection_that_was_given_up_brings_nothing_more() -> None:
    clock = _Clock()
    ring = FrameRing(10)
    intake = Intake(ring, clock=clock)
    intake.begin(0)
    intake.take(0, frame(0))
    clock.now_s += 0.9
    assert intake.interrupt(0, CameraError("gone"))
    assert not intake.interrupt(0, CameraError("gone"))
    assert not intake.take(0, frame(1))
    assert not intake.finish(0)
    clock.now_s += 2.0
    intake.begin(1)
    clock.now_s += 0.1
    assert intake.take(1, frame(0))
    (gone,) = intake.account().interruptions
    assert (gone.after_frames, gone.reason) == (1, "gone")
    assert (gone.noticed_after_s, gone.back_after_s) == pytest.approx((0.9, 3.0))
    assert [(arrival.connection, arrival.arrived_s) for arrival in ring.read(0)[0]] == [(0, 100.0), (1, 103.0)]


@pytest.mark.parametrize("rows", [5, 7])
def test_frames_of_another_size_are_refused(rows: int) -> None:
    intake = Intake(FrameRing(10))
    intake.begin(0)
    intake.take(0, frame(0))
    with pytest.raises(ImageMismatchError, match=f"8 x 6 .* frame 1 has 8 x {rows}"):
        intake.take(0, frame(1, rows=rows))
    assert intake.account().received == 1


def test_a_loose_plug_does_not_fill_the_memory() -> None:
    intake = Intake(FrameRing(1))
    for number in range(1500):
        intake.begin(number)
        intake.take(number, frame(0))
        intake.interrupt(number, CameraError("gone"))
    account = intake.account()
    assert (account.connections, len(account.interruptions)) == (1500, 1000)
    assert account.interruptions[-1].after_frames == 1500


def test_of_two_connections_the_first_to_open_is_taken() -> None:
    intake = Intake(FrameRing(10))
    assert intake.begin(1)
    assert not intake.begin(0)  # it was begun before, and opened after
    assert intake.connection == 1
    assert not intake.take(0, frame(0))
    assert intake.account().connections == 1


@given(rate=st.floats(2.0, 500.0), start=st.floats(-1e3, 1e3))
def test_regular_frames_have_their_rate(rate: float, start: float) -> None:
    measured = FrameRate()
    times = [start + number / rate for number in range(int(4 * rate))]
    for time_s in times:
        measured.add(time_s)
    assert measured.per_s(times[-1]) == pytest.approx(rate, rel=1e-6)


def test_a_stall_lowers_the_rate_before_the_window_forgets() -> None:
    measured = FrameRate(window_s=2.0)
    for number in range(61):
        measured.add(number / 30)
    falling = [measured.per_s(2.0 + waited) for waited in (0.0, 0.5, 1.0, 1.9)]
    assert falling == sorted(falling, reverse=True)
    assert falling[1] == pytest.approx(45 / 2.0, rel=0.05)  # 1.5 s of frames in a window of 2 s
    assert measured.per_s(5.0) == 0.0


def test_no_rate_without_two_frames() -> None:
    measured = FrameRate()
    assert measured.per_s(0.0) == 0.0
    measured.add(1.0)
    assert measured.per_s(1.0) == 0.0


class _Bench:
    """Cameras handed out one after another, and a clock that stands still until it is moved."""

    def __init__(self, *cameras: ScriptedCamera) -> None:
        self.cameras, self.handed, self.now_s, self.looks = cameras, 0, 0.0, 0

    def connect(self) -> ScriptedCamera:
        camera = self.cameras[min(self.handed, len(self.cameras) - 1)]
        self.handed += 1
        return camera

    def clock(self) -> float:
        self.looks += 1
        return self.now_s

    def look(self) -> None:
        """Wait until the watch has looked at the clock at several steps."""
        seen = self.looks + 6
        until(lambda: self.looks > seen)

    def go_on_to(self, until_s: float) -> None:
        """Let time go on as the watch sees it where the computer is not busy."""
        while self.now_s < until_s:
            self.now_s = min(self.now_s + 0.2, until_s)
            self.look()

    def acquisition(self, **options: object) -> Acquisition:
        return Acquisition(self.connect, clock=self.clock, retry_s=0.0, **options)  # type: ignore[arg-type]


@pytest.fixture(autouse=True)
def _short_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the watch look often: time itself is the bench's."""
    monkeypatch.setattr(acquisition, "WATCH_STEP_S", 0.01)


@pytest.fixture(autouse=True)
def _no_thread_stays() -> Iterator[None]:
    before = threading.active_count()
    yield
    until(lambda: threading.active_count() <= before)


def test_frames_arrive_in_order_and_are_counted() -> None:
    camera = ScriptedCamera()
    bench = _Bench(camera)
    for sequence in (0, 1, 4):
        camera.script.put(frame(sequence, level=sequence))
    with bench.acquisition() as acquisition:
        until(lambda: acquisition.ring.end == 3)
        latest = acquisition.latest()
        account = acquisition.account()
    assert latest is not None
    assert latest.frame.pixels[0, 0] == 4
    assert (account.received, account.missed, account.connections) == (3, 2, 1)
    assert camera.stops >= 1


def test_stored_frames_come_to_an_end_which_is_no_loss() -> None:
    camera = ScriptedCamera()
    for item in (frame(0), frame(1), END):
        camera.script.put(item)
    with _Bench(camera).acquisition() as acquisition:
        until(lambda: acquisition.ended)
        assert not acquisition.lost
        assert acquisition.failure is None
        assert acquisition.ring.closed
        assert acquisition.account().received == 2


def test_what_opening_says_reaches_the_caller() -> None:
    with pytest.raises(CameraError, match="held by another program"):
        _Bench(ScriptedCamera(fails_to_open=True)).acquisition().start()
    with pytest.raises(UnknownNameError, match=r"no mode is called '8x7@30'; did you mean '8x6@30'"):
        _Bench(ScriptedCamera()).acquisition(mode="8x7@30").start()
    with pytest.raises(InputError, match="gain must lie in"):
        _Bench(ScriptedCamera()).acquisition(settings={"gain": 99.0}).start()


@pytest.mark.parametrize("deaf", [False, True])
def test_a_silent_camera_is_lost_and_a_new_one_takes_over(deaf: bool) -> None:
    first, second = ScriptedCamera(deaf=deaf), ScriptedCamera()
    bench = _Bench(first, second)
    first.script.put(frame(0, level=1))
    with bench.acquisition(settings={"gain": 3.0}, mode="4x3@60") as acquisition:
        until(lambda: acquisition.ring.end == 1)
        bench.go_on_to(0.7)
        kept = acquisition.latest()
        until(lambda: not acquisition.lost)
        bench.go_on_to(0.9)
        until(lambda: acquisition.lost or bench.handed == 2)
        assert "no frame came for 0.9 s" in str(acquisition.failure)
        bench.now_s = 6.5
        if deaf:  # a driver that does not return is waited for before another is tried
            bench.look()
            assert bench.handed == 1
            first.script.put(frame(1, level=9))  # it returns at last, with a frame that nobody wants any more
        until(lambda: bench.handed == 2)
        second.script.put(frame(0, level=2))
        until(lambda: acquisition.ring.end == 2 and not acquisition.lost)
        assert second.gain == 3.0
        assert second.started_in == second.modes()[1]
        until(lambda: first.stops >= 2)
        seen = acquisition.ring.read(0)[0]
        (gone,) = acquisition.account().interruptions
    assert [(a.connection, int(a.frame.pixels[0, 0])) for a in seen] == [(0, 1), (1, 2)]
    assert kept is seen[0]
    assert gone.noticed_after_s == pytest.approx(0.9)
    assert gone.back_after_s == pytest.approx(6.5)


def test_a_driver_that_breaks_is_named_and_tried_again() -> None:
    first, second = ScriptedCamera(), ScriptedCamera()
    bench = _Bench(first, ScriptedCamera(fails_to_open=True), second)
    first.script.put(frame(0))
    first.script.put(BREAK)
    second.script.put(frame(0))
    with bench.acquisition() as acquisition:
        until(lambda: acquisition.ring.end == 2)
        account = acquisition.account()
    assert account.interruptions[0].reason == "the camera's driver failed: RuntimeError: bulk transfer failed"
    assert account.connections == 2
    assert bench.handed == 3


def test_a_loss_without_reconnection_ends_the_stream_with_its_reason() -> None:
    camera = ScriptedCamera()
    camera.script.put(frame(0))
    camera.script.put(BREAK)
    with _Bench(camera).acquisition(reconnect=False) as acquisition:
        until(lambda: acquisition.ended)
        assert "bulk transfer failed" in str(acquisition.failure)
        assert acquisition.account().received == 1


def test_a_change_of_size_in_mid_sequence_is_a_loss() -> None:
    first, second = ScriptedCamera(), ScriptedCamera()
    for item in (frame(0), frame(1, rows=5)):
        first.script.put(item)
    second.script.put(frame(0))
    with _Bench(first, second).acquisition() as acquisition:
        until(lambda: acquisition.ring.end == 2)
        assert "frames of one stream must have one format" in acquisition.account().interruptions[0].reason


def test_adjustments_reach_the_camera_and_its_successor() -> None:
    first, second = ScriptedCamera(), ScriptedCamera()
    with _Bench(first, second).acquisition() as acquisition:
        acquisition.adjust("gain", 5.0)
        assert acquisition.settings()[0].value == 5.0
        with pytest.raises(UnknownNameError):
            acquisition.adjust("brigthness", 1.0)
        first.script.put(BREAK)
        until(lambda: second.gain == 5.0)
    with pytest.raises(CameraError, match="not connected"):
        acquisition.adjust("gain", 1.0)


def test_it_runs_once() -> None:
    with _Bench(ScriptedCamera()).acquisition() as acquisition, pytest.raises(CameraError, match="runs already"):
        acquisition.start()
    acquisition.stop()


def test_stored_frames_wait_for_a_slow_reader_and_are_no_silent_camera() -> None:
    camera = ScriptedCamera()
    for sequence in range(9):
        camera.script.put(frame(sequence, level=sequence))
    camera.script.put(END)
    bench = _Bench(camera)
    seen: list[int] = []
    with bench.acquisition(ring_frames=2, patient=True) as acquisition:
        place, overrun = 0, 0
        while not acquisition.ring.closed or acquisition.ring.wait(place, 0.0):
            until(lambda: not acquisition.ring.has_room() or acquisition.ring.closed)
            bench.now_s += 100.0  # the reader pauses; nobody calls the camera lost
            arrivals, place, skipped = acquisition.ring.read(place)
            overrun += skipped
            seen += [arrival.frame.sequence for arrival in arrivals]
        assert acquisition.account().interruptions == ()
    assert (seen, overrun) == (list(range(9)), 0)


def test_a_camera_that_opens_slowly_comes_back_after_any_absence() -> None:
    class SlowToOpen(ScriptedCamera):
        """Opens when it is let; a camera that is searched for on a network takes a second or more."""

        def __init__(self) -> None:
            super().__init__()
            self.may_open, self.opening = threading.Event(), threading.Event()

        def open(self) -> None:
            self.opening.set()
            assert self.may_open.wait(HANGS_S)

    first, second = ScriptedCamera(), SlowToOpen()
    bench = _Bench(first, second)
    first.script.put(frame(0))
    with bench.acquisition() as acquisition:
        until(lambda: acquisition.ring.end == 1)
        first.script.put(BREAK)
        bench.now_s = 60.0  # long without a frame, which is no reason to give up the one that opens now
        assert second.opening.wait(HANGS_S)
        bench.look()
        assert bench.handed == 2
        second.script.put(frame(0))
        second.may_open.set()
        until(lambda: acquisition.ring.end == 2)
        assert acquisition.account().connections == 2


def test_a_busy_computer_is_no_silent_camera() -> None:
    camera = ScriptedCamera()
    bench = _Bench(camera)
    with bench.acquisition() as acquisition:
        for sequence in range(3):
            camera.script.put(frame(sequence))
            until(lambda so_many=sequence + 1: acquisition.ring.end == so_many)  # type: ignore[misc]
            bench.now_s += 5.0  # in which nothing of this program ran
            bench.look()
        assert acquisition.account().interruptions == ()
        bench.go_on_to(15.9)  # now it runs, and hears nothing
        until(lambda: acquisition.lost or bench.handed == 2)


FRAMES_PER_S = 30.0
LOSS_EVERY_S = 1800.0


class SimulatedDay:
    """A camera whose clock stands still between frames, and which is lost every half hour."""

    def __init__(self) -> None:
        self.now_s, self.lost, self.frames_made = 0.0, False, 0
        rng = np.random.default_rng(1)
        self._pixels = [rng.integers(0, 256, (492, 768), dtype=np.uint8) for _ in range(4)]
        self._running = threading.Event()

    name = "simulated day"

    def open(self) -> None:
        """Nothing to take hold of."""
        self.lost = False

    def modes(self) -> tuple[Mode, ...]:
        """The one mode."""
        return (Mode(width_px=768, height_px=492, frames_per_s=FRAMES_PER_S),)

    def settings(self) -> tuple[Setting, ...]:
        """None."""
        return ()

    def adjust(self, name: str, value: float) -> None:
        """Refuse."""
        raise CameraError(f"{name} cannot be set to {value:g}")

    def start(self, mode: Mode | None = None) -> None:
        """Begin."""
        self._running.set()

    def frames(self) -> Iterator[Frame]:
        """Half an hour of frames, then a loss."""
        sequence, ends_s = 0, self.now_s + LOSS_EVERY_S
        while self._running.is_set():
            self.now_s += 1 / FRAMES_PER_S
            if self.now_s > ends_s:
                self.lost = True
                self.now_s += 1.0
                raise CameraError("the simulated camera was unplugged")
            self.frames_made += 1
            yield Frame(pixels=self._pixels[sequence % 4], sequence=sequence, time_s=self.now_s)
            sequence += 1

    def stop(self) -> None:
        """End."""
        self._running.clear()


def held() -> tuple[float, int]:
    """Resident memory in MB and open descriptors of this process."""
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6, len(list(Path("/proc/self/fd").iterdir()))


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="memory is measured as Linux tells it")
def test_hours_of_frames_and_losses_leave_memory_as_it_was() -> None:
    source, hours = SimulatedDay(), scaled(6)
    acquisition = Acquisition(lambda: source, clock=lambda: source.now_s, retry_s=0.0)
    acquisition.start()
    until(lambda: source.now_s >= 3600 * hours / 20)
    before_mb, descriptors = held()
    until(lambda: source.now_s >= 3600 * hours)
    after_mb, descriptors_after = held()
    account = acquisition.account()
    acquisition.stop()
    assert account.connections >= 2 * hours - 1
    assert after_mb - before_mb < 20
    assert descriptors_after == descriptors
