from __future__ import annotations

import json
from datetime import UTC, datetime

from hypothesis import assume, given
from hypothesis import strategies as st

from tsis.files import canonical, digest
from tsis.study import read_chain
from tsis.study._log import FIRST, Chain, Draft, link_entries

WHEN = datetime(2026, 1, 1, tzinfo=UTC)
EMPTY = Chain(entries=(), lines=0, breaks={})
WORDS = st.lists(st.text(max_size=8), min_size=2, max_size=7)


def written(words: list[str]) -> list[bytes]:
    said = [{"word": word, "at": place} for place, word in enumerate(words)]
    drafts = [Draft(actor="Ada", action="said", content=each) for each in said]
    return [entry.line().encode() for entry in link_entries(EMPTY, drafts, WHEN)]


def content(lines: list[bytes]) -> bytes:
    return b"".join(line + b"\n" for line in lines)


@given(WORDS)
def test_what_was_written_is_read(words: list[str]) -> None:
    chain = read_chain(content(written(words)))
    assert not chain.breaks
    assert [entry.content["word"] for entry in chain.entries] == [json.loads(canonical(word)) for word in words]
    assert chain.entries[0].previous == FIRST
    assert chain.head == chain.entries[-1].hash


@given(WORDS, st.data())
def test_every_changed_byte_is_found_in_its_line(words: list[str], data: st.DataObject) -> None:
    whole = content(written(words))
    place = data.draw(st.integers(0, len(whole) - 1))
    byte = data.draw(st.integers(0, 255))
    assume(byte != whole[place])
    changed = whole[:place] + bytes([byte]) + whole[place + 1 :]
    line = whole[:place].count(b"\n") + 1
    breaks = read_chain(changed).breaks
    assert line in breaks or line + 1 in breaks  # the second where a line's end was changed


@given(WORDS, st.data())
def test_every_line_taken_out_put_in_or_moved_is_found(words: list[str], data: st.DataObject) -> None:
    lines = written(words)
    one = data.draw(st.integers(0, len(lines) - 2))
    other = data.draw(st.integers(one + 1, len(lines) - 1))
    swapped = lines.copy()
    swapped[one], swapped[other] = lines[other], lines[one]
    without = lines[:one] + lines[one + 1 :]
    doubled = [*lines[: one + 1], lines[one], *lines[one + 1 :]]
    foreign = [*lines[: one + 1], written(["x", *words])[0], *lines[one + 1 :]]
    for each in (swapped, without, doubled, foreign):
        assert read_chain(content(each)).breaks


@given(WORDS, st.data())
def test_a_line_that_was_made_to_fit_breaks_the_next_and_the_last_changes_the_head(
    words: list[str], data: st.DataObject
) -> None:
    lines = written(words)
    place = data.draw(st.integers(0, len(lines) - 1))
    forged = json.loads(lines[place])
    forged["content"]["word"] += "!"
    forged["hash"] = digest({name: value for name, value in forged.items() if name != "hash"})
    changed = lines.copy()
    changed[place] = canonical(forged).encode()
    chain = read_chain(content(changed))
    if place < len(lines) - 1:
        assert set(chain.breaks) == {place + 2}
    else:
        assert not chain.breaks
        assert chain.head != read_chain(content(lines)).head


@given(WORDS, st.integers(1, 200))
def test_a_cut_line_is_found_and_cut_lines_change_the_head(words: list[str], cut: int) -> None:
    whole = content(written(words))
    assume(cut < len(whole))
    chain = read_chain(whole[:-cut])
    assert chain.breaks or chain.head != read_chain(whole).head


@given(st.binary(max_size=200))
def test_no_bytes_make_it_fail(noise: bytes) -> None:
    chain = read_chain(noise)
    assert not noise or chain.breaks


def test_hostile_lines_are_breaks() -> None:
    for line in (b"[]", b"1", b"{}", b'{"number":1e400}', b"[" * 5000, b'{"hash":NaN}', b'"\xff"'):
        assert list(read_chain(line + b"\n").breaks) == [1]
    deep = written(["a"])[0].replace(b'"word":"a"', b'"word":' + b"[" * 400 + b"]" * 400)
    assert list(read_chain(deep + b"\n").breaks) == [1]
    null = written(["a"])[0].replace(b'{"action"', b'{"absent":null,"action"')
    assert list(read_chain(null + b"\n").breaks) == [1]
