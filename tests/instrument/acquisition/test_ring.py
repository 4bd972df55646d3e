from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.instrument.scripted_camera import frame

from tsis.errors import InputError
from tsis.instrument.acquisition import FrameRing, ReceivedFrame


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
