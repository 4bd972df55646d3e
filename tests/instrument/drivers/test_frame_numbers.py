from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from tsis.instrument.drivers.frame_numbers import BlockCount

GAPS = st.lists(st.integers(1, 20_000), max_size=40)


@given(first=st.integers(0, 200_000), gaps=GAPS)
def test_numbers_of_a_gige_camera_are_followed_through_their_wrap(first: int, gaps: list[int]) -> None:
    count, true = BlockCount(), first
    assert count.at(1 + true % 65535) == 0  # GigE Vision has no block 0
    for gap in gaps:
        true += gap
        assert count.at(1 + true % 65535) == true - first


@given(first=st.integers(0, 2**62), gaps=GAPS)
def test_wide_numbers_are_followed(first: int, gaps: list[int]) -> None:
    count, true = BlockCount(), first
    count.at(true)
    for gap in gaps:
        true += gap
        assert count.at(true) == true - first


def test_a_camera_that_begins_anew_or_repeats_itself_goes_on_without_a_gap() -> None:
    count = BlockCount()
    assert [count.at(number) for number in (100_000, 3, 4, 4, 0, 1)] == [0, 1, 2, 3, 4, 5]


def test_frames_without_numbers_are_counted() -> None:
    count = BlockCount()
    assert [count.at(None) for _ in range(3)] == [0, 1, 2]


def test_a_torn_first_frame_counts() -> None:
    count = BlockCount()
    count.begin(100)
    count.begin(90)  # torn frames are reported late
    assert [count.at(number) for number in (102, 103, 1, 2)] == [2, 3, 4, 5]


def test_a_first_frame_without_its_first_packet_has_no_number() -> None:
    count = BlockCount()
    count.begin(0)  # as GigE Vision's drivers report it
    assert [count.at(number) for number in (65401, 65402, 65404)] == [0, 1, 3]
