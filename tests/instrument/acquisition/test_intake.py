from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.instrument.scripted_camera import frame

from tsis.errors import CameraError, ImageMismatchError
from tsis.instrument.acquisition import FrameRing, Intake


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
