"""Tables on paper: columns as wide as their texts need, cells of any length, headings on every page."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from reportlab.platypus import LongTable, Paragraph

from tsis.report.paper._text import (
    CELL,
    CELL_HEADING,
    LINE,
    SANS,
    SMALL,
    TINT,
    WIDTH,
    drawable_text,
    escaped,
    paragraphs,
    pieces,
    width,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from reportlab.lib.styles import ParagraphStyle


PADDING = 3.0
LINES = 12  # of a cell; the rest of a longer text continues in a new row, which may be on the next page
MOST_COLUMNS = 10
LONGEST_HEADING = 80  # letters; a row with more is not repeated
ROOM = 0.5  # extra width of a column in points, against rounding

Rows = tuple[tuple[str, ...], ...]


def table(headings: Sequence[str], rows: Sequence[Sequence[str]], *, cell: ParagraphStyle = CELL) -> list[Any]:
    """A table on paper; one with very many columns is cut, its first column before each part.

    There is no heading row without ``headings``; short rows are filled up.
    """
    if not rows:
        return paragraphs("None.", SMALL)
    count = max(len(headings), *(len(row) for row in rows))
    filled = tuple(_filled(row, count) for row in rows)
    names = _filled(headings, count) if headings else ()
    if count <= MOST_COLUMNS:
        return [_part(names, filled, cell)]
    cuts = [(0, *range(start, min(start + MOST_COLUMNS - 1, count))) for start in range(1, count, MOST_COLUMNS - 1)]
    return [_part(_chosen(names, cut), tuple(_chosen(row, cut) for row in filled), cell) for cut in cuts]


def column_widths(least: Sequence[float], requested: Sequence[float], available: float = WIDTH) -> list[float]:
    """Widths that fill ``available``: each at least its longest word if all of them can be, at best its longest text.

    Examples
    --------
    >>> column_widths([10, 10], [20, 60], 100)
    [30.0, 70.0]
    >>> column_widths([10, 40], [10, 990], 100)
    [10.0, 90.0]
    """
    if sum(requested) <= available:
        more = (available - sum(requested)) / len(requested)
        return [float(item + more) for item in requested]
    if sum(least) >= available:
        fair = available / len(least)  # columns that need less stay as they are
        modest = [min(item, fair) for item in least]
        want = [item - saved for item, saved in zip(least, modest, strict=True)]
        fraction = (available - sum(modest)) / sum(want) if sum(want) else 0.0
        return [float(saved + fraction * more) for saved, more in zip(modest, want, strict=True)]
    fraction = (available - sum(least)) / (sum(requested) - sum(least))
    return [float(low + fraction * (high - low)) for low, high in zip(least, requested, strict=True)]


def _filled(row: Sequence[str], count: int) -> tuple[str, ...]:
    return (*row, *("",) * (count - len(row)))


def _chosen(row: Sequence[str], cut: Sequence[int]) -> tuple[str, ...]:
    return tuple(row[position] for position in cut) if row else ()


def _part(headings: tuple[str, ...], rows: Rows, cell: ParagraphStyle) -> LongTable:
    names = tuple(drawable_text(name, CELL_HEADING.fontName) for name in headings)
    texts = tuple(tuple(drawable_text(text, cell.fontName) for text in row) for row in rows)
    widths = _widths(names, texts, cell)
    lines = [_cells(names, CELL_HEADING, widths)] if names else []
    ends = [len(first) - 1 for first in lines]
    repeated = int(bool(names) and max(map(len, names)) <= LONGEST_HEADING)
    cells = [row for first in lines for row in first]
    for row in texts:
        cells += _cells(row, cell, widths)
        ends.append(len(cells) - 1)
    looks: list[Any] = [
        ("FONTNAME", (0, 0), (-1, -1), SANS),  # of empty cells, whose default font is not embedded
        ("VALIGN", (0, 0), (-1, -1), "TOP"),
        ("LEFTPADDING", (0, 0), (-1, -1), PADDING),
        ("RIGHTPADDING", (0, 0), (-1, -1), PADDING),
        ("TOPPADDING", (0, 0), (-1, -1), 1.5),
        ("BOTTOMPADDING", (0, 0), (-1, -1), 2),
        *(("LINEBELOW", (0, end), (-1, end), 0.4, LINE) for end in ends),
    ]
    if names:
        looks.append(("BACKGROUND", (0, 0), (-1, ends[0]), TINT))
    return LongTable(cells, colWidths=widths, repeatRows=repeated, style=looks, spaceAfter=4)


def _cells(texts: tuple[str, ...], kind: ParagraphStyle, widths: Sequence[float]) -> list[list[Any]]:
    """A row of texts as rows of paragraphs: one, or several where a text is long."""
    cut = [
        list(pieces(text, kind.fontName, kind.fontSize, within=width - 2 * PADDING, lines=LINES))
        for text, width in zip(texts, widths, strict=True)
    ]
    return [
        [Paragraph(escaped(parts[index]), kind) if index < len(parts) else "" for parts in cut]
        for index in range(max(map(len, cut)))
    ]


def _widths(names: tuple[str, ...], texts: Rows, cell: ParagraphStyle) -> list[float]:
    around = 2 * PADDING + ROOM
    columns = list(zip(*texts, strict=True))
    titles = names or ("",) * len(columns)
    requested, least = [], []
    for name, column in zip(titles, columns, strict=True):
        requested.append(max(_wide(name, CELL_HEADING), *(_wide(text, cell) for text in column)) + around)
        least.append(max(_word_width(name, CELL_HEADING), *(_word_width(text, cell) for text in column)) + around)
    return column_widths(least, requested)


def _wide(text: str, kind: ParagraphStyle) -> float:
    return min(width(text, kind.fontName, kind.fontSize), float(WIDTH))


def _word_width(text: str, kind: ParagraphStyle) -> float:
    return min(max((width(part, kind.fontName, kind.fontSize) for part in text.split()), default=0.0), float(WIDTH))
