"""A page for people on a terminal: its tables and texts, without its pictures."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.box import SIMPLE_HEAD
from rich.cells import cell_len
from rich.console import Console
from rich.markup import escape
from rich.table import Table as RichTable

from tsis.__about__ import RESEARCH_USE_ONLY

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from tsis.present.page import Table


def people() -> Console:
    """Standard output for people."""
    return Console(highlight=False)


def print_notice(console: Console) -> None:
    """The sentence that every output carries."""
    console.print(RESEARCH_USE_ONLY, style="bold")


def print_tables(tables: Iterable[RichTable], notes: Iterable[str], *, where: str = "") -> None:
    """Print tables, notes and where the files are, if any, for people."""
    console = people()
    for table in tables:
        console.print(table)
    for note in notes:
        console.print(f"- {note}", markup=False)
    if where:
        console.print(where, soft_wrap=True, markup=False)
    print_notice(console)


def rich_tables(items: Sequence[Table]) -> list[RichTable]:
    """Tables of a page; where the terminal is narrow, lines break between words and never in one."""
    shown = []
    for item in items:
        table = RichTable(*item.headings, title=escape(item.title), box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
        for column, *cells in zip(table.columns, item.headings, *item.rows, strict=True):
            column.min_width = max((cell_len(word) for cell in cells for word in cell.split()), default=0)
        for row in item.rows:
            table.add_row(*(escape(cell) for cell in row))
        shown.append(table)
    return shown
