from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import pytest
from tests.instrument.scripted_camera import BREAK, END, ScriptedCamera, frame
from tests.waiting import HANGS_S, until

from tsis.errors import CameraError, InputError, UnknownNameError
from tsis.instrument import acquisition
from tsis.instrument.acquisition import Acquisition

if TYPE_CHECKING:
    from collections.abc import Iterator


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
