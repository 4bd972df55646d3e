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

    from rich.console import ConsoleOptions, RenderResult

    from tsis.present.page import Page, Table

LEAST_TEXT = 10  # columns of a text whose words are broken


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


class _FittingTable(RichTable):
    """A table as wide as its terminal at most; the library's own narrows the widest column first and can lose one."""

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        texts = [[str(column.header), *map(str, column.cells)] for column in self.columns]
        whole = [max(map(cell_len, cells)) for cells in texts]
        widths = [max(cell_len(word) for cell in cells for word in ["", *cell.split()]) for cells in texts]
        room = options.max_width - 2 * len(widths) - 1  # a space after each column, and what is drawn between them
        if sum(whole) <= room:
            yield from super().__rich_console__(console, options)
            return
        broken = [at for at, column in enumerate(self.columns) if column.justify == "left"]  # texts, never numbers
        while sum(widths) > room and any(widths[at] > LEAST_TEXT for at in broken):
            widths[max(broken, key=lambda at: widths[at])] -= 1
        while sum(widths) < room and any(width < most for width, most in zip(widths, whole, strict=True)):
            short = [at for at, most in enumerate(whole) if widths[at] < most]
            widths[min(short, key=lambda at: widths[at])] += 1
        for column, width in zip(self.columns, widths, strict=True):
            column.width, column.overflow = width, "fold"
        yield from super().__rich_console__(console, options)


def rich_table(table: Table) -> RichTable:
    """A table for a terminal; where that is narrow, lines break between words, in one only where it has no room."""
    shown = _FittingTable(*table.headings, title=escape(table.title), box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for column, item in zip(shown.columns, table.columns, strict=True):
        column.justify = "left" if isinstance(item, str) else "right"
    for row in table.rows:
        shown.add_row(*(escape(cell) for cell in row))
    return shown
