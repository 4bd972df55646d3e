from __future__ import annotations

import json
from datetime import UTC, datetime
from typing import IO, TYPE_CHECKING

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tsis.errors import RecordsError
from tsis.files.atomic import Disk
from tsis.files.canonical_json import canonical, digest
from tsis.files.hash_chain import (
    EMPTY_CHAIN,
    FIRST_HASH,
    LogChain,
    LogDraft,
    append_entries,
    link_entries,
    read_chain,
    read_chain_file,
)

if TYPE_CHECKING:
    from pathlib import Path

WHEN = datetime(2026, 1, 1, tzinfo=UTC)
WORDS = st.lists(st.text(max_size=8), min_size=2, max_size=7)


def written(words: list[str]) -> list[bytes]:
    said = [{"word": word, "at": place} for place, word in enumerate(words)]
    drafts = [LogDraft(actor="Ada", action="said", content=each) for each in said]
    return [entry.line().encode() for entry in link_entries(EMPTY_CHAIN, drafts, WHEN)]


def content(lines: list[bytes]) -> bytes:
    return b"".join(line + b"\n" for line in lines)


@given(WORDS)
def test_what_was_written_is_read(words: list[str]) -> None:
    chain = read_chain(content(written(words)))
    assert not chain.breaks
    assert [entry.content["word"] for entry in chain.entries] == [json.loads(canonical(word)) for word in words]
    assert chain.entries[0].previous == FIRST_HASH
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


@given(WORDS, st.data())
def test_a_log_read_in_two_parts_is_the_log(words: list[str], data: st.DataObject) -> None:
    lines = written(words)
    lines[data.draw(st.integers(0, len(lines) - 1))] += data.draw(st.sampled_from([b"", b"x"]))
    cut = data.draw(st.integers(0, len(lines)))
    assert read_chain(content(lines[cut:]), read_chain(content(lines[:cut]))) == read_chain(content(lines))


class CountingDisk(Disk):
    """Counts the bytes that are read and written."""

    def __init__(self) -> None:
        self.read = self.written = 0

    def read_from(self, path: Path, start: int) -> bytes:
        found = super().read_from(path, start)
        self.read += len(found)
        return found

    def write(self, file: IO[bytes], content: bytes) -> None:
        self.written += len(content)
        super().write(file, content)


def long_log(path: Path, entries: int) -> LogChain:
    drafts = [LogDraft(actor="Ada", action="said", content={"word": "same"})] * entries
    path.write_bytes(content([entry.line().encode() for entry in link_entries(EMPTY_CHAIN, drafts, WHEN)]))
    return read_chain_file(path)


def say(_chain: LogChain) -> list[LogDraft]:
    return [LogDraft(actor="Ada", action="said", content={"word": "more"})]


def test_an_append_reads_and_writes_as_much_at_entry_10_as_at_entry_10_000(tmp_path: Path) -> None:
    cost = {}
    for entries in (10, 10_000):
        path, disk = tmp_path / f"{entries}.jsonl", CountingDisk()
        known = long_log(path, entries)
        for _ in range(3):
            known = append_entries(path, say, WHEN, log_chain=known, cure="", disk=disk)
        cost[entries] = (disk.read, disk.written)
        assert known == read_chain(path.read_bytes())
    digits = 3 * 3  # entry 10 000 has three digits more than entry 10
    assert all(short < long <= short + digits for short, long in zip(cost[10], cost[10_000], strict=True))


def test_entries_of_others_are_read_and_kept(tmp_path: Path) -> None:
    path = tmp_path / "log"
    known = long_log(path, 5)
    append_entries(path, say, WHEN, cure="")
    after = append_entries(path, say, WHEN, log_chain=known, cure="")
    assert after.lines == 7
    assert after == read_chain_file(path)


@pytest.mark.parametrize("change", ["cut", "last", "rewritten"])
def test_a_log_that_no_longer_ends_as_it_was_read_is_read_anew(tmp_path: Path, change: str) -> None:
    path = tmp_path / "log"
    known = long_log(path, 5)
    lines = path.read_bytes().splitlines(keepends=True)
    if change == "cut":
        path.write_bytes(b"".join(lines[:3]))
        assert append_entries(path, say, WHEN, log_chain=known, cure="").lines == 4
        return
    path.write_bytes(b"".join(lines[:-1]) + lines[-1].replace(b"same", b"tame") if change == "last" else b"x\n" * 90)
    with pytest.raises(RecordsError, match="must be as it was written before anything is added"):
        append_entries(path, say, WHEN, log_chain=known, cure="verify it")


def test_what_a_power_loss_leaves_of_an_append_is_removed_by_the_next(tmp_path: Path) -> None:
    path = tmp_path / "log"
    long_log(path, 5)
    whole = path.read_bytes()
    path.write_bytes(whole + b'{"action":"sa')
    assert read_chain_file(path).breaks == {6: "is cut short"}
    chain = append_entries(path, say, WHEN, cure="")
    assert path.read_bytes() == whole + f"{chain.entries[-1].line()}\n".encode()
    assert read_chain_file(path) == chain
