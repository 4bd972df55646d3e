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
    from collections.abc import Iterable

    from tsis.present.page import Page, Table


def people() -> Console:
    """Standard output for people."""
    return Console(highlight=False)


def print_notice(console: Console) -> None:
    """The sentence that every output carries."""
    console.print(RESEARCH_USE_ONLY, style="bold")


def print_page(page: Page, *, where: str = "") -> None:
    """Print the tables and texts of a page, what was not estimated, and where the files are, if any."""
    console = people()
    console.print(page.title, style="bold", markup=False)
    if page.subtitle:
        console.print(page.subtitle, markup=False)
    refused = (f"Not estimated: {what}: {reason}." for what, reason in page.refused)
    print_tables(page.tables, (*page.notes, *refused), where=where)


def print_tables(tables: Iterable[Table], notes: Iterable[str] = (), *, where: str = "") -> None:
    """Print tables, notes and where the files are, if any."""
    console = people()
    for table in tables:
        console.print(rich_table(table))
    for note in notes:
        console.print(f"- {note}", markup=False)
    if where:
        console.print(where, soft_wrap=True, markup=False)
    print_notice(console)


def rich_table(table: Table) -> RichTable:
    """A table for a terminal; where that is narrow, lines break between words and never in one."""
    shown = RichTable(*table.headings, title=escape(table.title), box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for column, item, *cells in zip(shown.columns, table.columns, table.headings, *table.rows, strict=True):
        column.min_width = max((cell_len(word) for cell in cells for word in cell.split()), default=0)
        column.justify = "left" if isinstance(item, str) else "right"
    for row in table.rows:
        shown.add_row(*(escape(cell) for cell in row))
    return shown
