"""JSON and text from anywhere: capped before it is parsed, refused in one sentence."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.errors import FileInputError
from tsis.files.reading import (
    DEEPEST,
    LONGEST_LINE,
    MOST_VALUES,
    one_line,
    read_bytes,
    read_head,
    read_object,
    text_lines,
)

if TYPE_CHECKING:
    from pathlib import Path


def _nested(depth: int) -> bytes:
    return b'{"a": ' * depth + b"1" + b"}" * depth


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b'{"a": [' + b"1," * MOST_VALUES + b"1]}", f"at most {MOST_VALUES} values"),
        (_nested(DEEPEST + 1), f"at most {DEEPEST} deep"),
        (_nested(900), f"at most {DEEPEST} deep"),
        (_nested(100_000), "readable JSON"),
        (b'{"a": ' + b"9" * 5000 + b"}", "4300 digits"),
        (b'{"a": "\xff"}', "readable JSON"),
        (b"plain text", "begins otherwise"),
        (b"[1]", "must hold a JSON object; got list"),
        (b"\0" * 100, "begins otherwise"),
    ],
)
def test_json_that_is_a_trap_is_refused(tmp_path: Path, content: bytes, said: str) -> None:
    (tmp_path / "a.json").write_bytes(content)
    with pytest.raises(FileInputError, match=said) as refused:
        read_object(tmp_path / "a.json")
    assert str(refused.value).isprintable()


def test_json_at_its_bounds_is_read(tmp_path: Path) -> None:
    for content in (_nested(DEEPEST), b'\xef\xbb\xbf \n{"a": 1}', json.dumps({"a": [1] * (MOST_VALUES - 2)}).encode()):
        (tmp_path / "a.json").write_bytes(content)
        assert list(read_object(tmp_path / "a.json")) == ["a"]


def test_what_is_larger_than_its_cap_is_never_read(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    with path.open("wb") as file:
        file.write(b"{")
        file.truncate(2**40)
    assert read_head(path, 3) == b"{\0\0"
    with pytest.raises(FileInputError, match="must be at most 8388608 bytes; got 1099511627776"):
        read_object(path)
    with pytest.raises(FileInputError, match="must be at most 10 bytes"):
        read_bytes(path, most=10)


def test_large_json_must_be_ascii(tmp_path: Path) -> None:
    letters = "a" * (9 * 2**20)
    (tmp_path / "a.json").write_text(json.dumps({"a": letters}))
    assert read_object(tmp_path / "a.json", most=2**24) == {"a": letters}
    (tmp_path / "a.json").write_text(json.dumps({"a": letters + "é"}, ensure_ascii=False), encoding="utf-8")
    with pytest.raises(FileInputError, match="must be ASCII"):
        read_object(tmp_path / "a.json", most=2**24)


@given(text=st.text(max_size=300))
def test_what_a_decoder_says_becomes_part_of_a_line(text: str) -> None:
    found = one_line(ValueError(text), 80)
    assert found.isprintable()
    assert 0 < len(found) <= 80


@given(lines=st.lists(st.text(st.characters(blacklist_categories=("Cs", "Cc")), max_size=20), max_size=8))
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_lines_end_as_on_any_system(lines: list[str], end: str) -> None:
    content = end.join(["first", *lines, "last"]).encode()
    assert [text for _, text in text_lines(content, most=100)] == ["first", *lines, "last"]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"\n" * 20_000, "at most 100 lines; got 20000"),
        (b"\r" * 20_000, "at most 100 lines; got 20000"),
        (b"1\n" + b"a" * (LONGEST_LINE + 1), "line 2 must be at most 65536 bytes"),
        (b"1\n\xff\n", "line 2 must be text in UTF-8"),
    ],
)
def test_lines_that_are_a_trap_are_refused(content: bytes, said: str) -> None:
    with pytest.raises(FileInputError, match=said):
        list(text_lines(content, most=100))
