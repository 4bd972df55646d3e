from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.instrument.acquisition import FrameRate


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
