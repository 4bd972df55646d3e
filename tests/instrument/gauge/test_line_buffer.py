from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from tsis.instrument.serial_gauge import LONGEST_REPLY_BYTES, Line, LineBuffer


def _fed(buffer: LineBuffer, *chunks: bytes) -> list[Line]:
    return [line for k, chunk in enumerate(chunks) for line in buffer.feed(chunk, since_s=float(k), now_s=k + 1.0)]


def test_a_line_that_was_entered_in_the_middle_is_not_whole() -> None:
    lines = _fed(LineBuffer(), b"23 N\r\n0.125 N\r", b"\n0.130 N\n")
    assert [(line.content, line.whole) for line in lines] == [(b"23 N", False), (b"0.125 N", True), (b"0.130 N", True)]


def test_a_line_is_dated_by_its_first_byte() -> None:
    first, second, third = _fed(LineBuffer(), b"\r\n12", b"34\r\nabcd\r", b"\nx\n")
    assert (first.content, first.time_s, first.time_error_s) == (b"1234", 0.5, 0.5)
    assert (second.content, second.time_s, second.time_error_s) == (b"abcd", 1 + 4 / 9, 5 / 9)
    assert 2 < third.time_s < 3


@given(st.lists(st.binary(max_size=300), max_size=20))
def test_memory_is_bounded_and_lines_are_those_of_the_text(chunks: list[bytes]) -> None:
    buffer = LineBuffer()
    lines = []
    for chunk in chunks:
        lines += buffer.feed(chunk, since_s=0.0, now_s=1.0)
        assert buffer.pending <= LONGEST_REPLY_BYTES
    whole = [line.content for line in lines if line.whole]
    # The slow reference: cut the whole text at once.
    text = b"".join(chunks).replace(b"\r", b"\n")
    *complete, _unfinished = text.split(b"\n")
    assert whole == [part for part in complete[1:] if part and len(part) <= LONGEST_REPLY_BYTES]
    assert all(len(line.content) <= LONGEST_REPLY_BYTES for line in lines)
