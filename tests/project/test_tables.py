"""Tables of the pages are whole: a row beside its table is shown as text with bars."""

from __future__ import annotations

from pathlib import Path

from markdown_it import MarkdownIt
from release.links import PAGES

ROOT = Path(__file__).parents[2]
TABLE = "| a | b |\n| --- | --- |\n| 1 | 2 |\n"


def rows_outside(text: str) -> list[str]:
    """The first line of each paragraph that begins as a row does."""
    parsed = MarkdownIt("commonmark").enable("table").parse(text)
    return [token.content.splitlines()[0] for token in parsed if token.type == "inline" and token.content[:1] == "|"]


def test_no_row_stands_outside_its_table() -> None:
    pages = sorted(path for pattern in PAGES for path in ROOT.glob(pattern) if "_build" not in path.parts)
    assert {path.name: rows for path in pages if (rows := rows_outside(path.read_text(encoding="utf-8")))} == {}


def test_a_row_after_an_empty_line_is_seen() -> None:
    assert rows_outside(TABLE + "| 3 | 4 |\n") == []
    assert rows_outside(TABLE + "\n| 3 | 4 |\n") == ["| 3 | 4 |"]
