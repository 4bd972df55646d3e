"""Tables of comma-separated values, with each cell by its heading."""

from __future__ import annotations

import csv
import io
import math
from typing import TYPE_CHECKING, Any

from tsis.errors import FileInputError
from tsis.files.reading import one_line, printable_path, read_bytes

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path


LARGEST_CSV_BYTES, MOST_ROWS, LONGEST_CELL = 32 * 2**20, 1_000_000, 500
# A spreadsheet takes text with such a start for a formula; an apostrophe before it prevents that.
FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r", "＝", "＋", "－", "＠", "'")


class CsvRow:
    """A row: text by heading; errors name ``where``, the file and line."""

    def __init__(self, where: str, cells: dict[str, str]) -> None:
        self.where, self._cells = where, cells

    def text(self, name: str) -> str:
        """Text of a cell without the apostrophe that guards it from spreadsheets."""
        text = self._cells.get(name, "").strip()
        guarded = text.startswith("'") and text[1:].lstrip().startswith(FORMULA_STARTS)
        return text[1:] if guarded else text

    def number(self, name: str) -> float | None:
        """A finite number; None where the cell is empty."""
        text = self._cells.get(name, "").strip()
        if not text:
            return None
        try:
            value = float(text) if text.isascii() and "_" not in text else math.nan
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise self.refused(name, "a finite number with a decimal point, or empty", text)
        return value

    def refused(self, name: str, requested: str, got: str) -> FileInputError:
        """The error for an invalid cell."""
        return FileInputError(f"{name} must be {requested}; got {got!r:.60} ({self.where})")


def read_csv_rows(path: Path, needed: Sequence[str], optional: Sequence[str] = ()) -> Iterator[CsvRow]:
    """Rows of a UTF-8 file whose first line names its columns, in any order: ``needed``, and ``optional`` ones.

    `FileInputError` when the file is no such table or has other columns; the message names the line.
    """
    return parse_csv_rows(read_bytes(path, most=LARGEST_CSV_BYTES), printable_path(path), needed, optional)


def parse_csv_rows(content: bytes, name: str, needed: Sequence[str], optional: Sequence[str] = ()) -> Iterator[CsvRow]:
    """Rows of the content of such a file, e.g. of an upload; errors call it ``name``."""
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise FileInputError(f"{name} must be a table in UTF-8; line {line} holds other bytes") from error
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    headings: list[str] | None = None
    try:
        for count, cells in enumerate(reader):
            where = f"{name}, line {reader.line_num}"
            if not any(cell.strip() for cell in cells):
                continue
            if count > MOST_ROWS or any(len(cell) > LONGEST_CELL for cell in cells):
                raise FileInputError(
                    f"{name} must have at most {MOST_ROWS} rows with cells of at most {LONGEST_CELL} letters; line "
                    f"{reader.line_num} goes beyond"
                )
            if headings is None:
                headings = _headings(cells, where, needed, optional)
            elif len(cells) != len(headings):
                raise FileInputError(
                    f"a row must have {len(headings)} cells, as the headings; got {len(cells)} ({where})"
                )
            else:
                yield CsvRow(where, dict(zip(headings, cells, strict=True)))
    except csv.Error as error:
        raise FileInputError(
            f"{name} must be a table of comma-separated values; line {reader.line_num}: {one_line(error)}"
        ) from error
    if headings is None:
        raise FileInputError(f"{name} must begin with the headings {', '.join(needed)}; it is empty")


def _headings(cells: list[str], where: str, needed: Sequence[str], optional: Sequence[str]) -> list[str]:
    names = [cell.strip() for cell in cells]
    lost = [name for name in needed if name not in names]
    if lost:
        raise FileInputError(f"the headings must hold {', '.join(needed)}; missing: {', '.join(lost)} ({where})")
    unknown = [name for name in names if name not in (*needed, *optional)]
    if unknown or len(set(names)) < len(names):
        wrong = repr(unknown[0])[:60] if unknown else "one of them twice"
        raise FileInputError(
            f"the headings must be {', '.join((*needed, *optional))}, each once; got {wrong} ({where})"
        )
    return names


def cell(value: Any) -> str:
    """The text of a cell, guarded so that no spreadsheet takes it for a formula.

    Examples
    --------
    >>> cell("=1+1"), cell(-1.5), cell(True), cell(None)
    ("'=1+1", '-1.5', 'yes', '')
    """
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, (int, float)):
        return repr(value)
    text = str(value)
    return f"'{text}" if text.startswith(FORMULA_STARTS) or text.lstrip().startswith(FORMULA_STARTS) else text


def table_bytes(rows: Sequence[Sequence[Any]]) -> bytes:
    """Rows, headings first, in the form of RFC 4180."""
    out = io.StringIO(newline="")
    writer = csv.writer(out, lineterminator="\r\n")
    writer.writerows([cell(item) for item in row] for row in rows)
    return out.getvalue().encode()
