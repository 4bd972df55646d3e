"""A page as a PDF file for paper and archives: A4, fonts embedded, the notice and a page number on every sheet."""

from __future__ import annotations

from tsis.errors import require_extra

require_extra("reportlab", feature="a report as PDF", extra="report")

import functools
import html
import io
import re
import threading
import unicodedata
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
from reportlab import rl_config
from reportlab.lib.colors import HexColor
from reportlab.lib.pagesizes import A4
from reportlab.lib.styles import ParagraphStyle
from reportlab.lib.units import mm
from reportlab.pdfbase import pdfmetrics
from reportlab.pdfbase.ttfonts import TTFont
from reportlab.pdfgen.canvas import Canvas
from reportlab.platypus import (
    BaseDocTemplate,
    CondPageBreak,
    Frame,
    Image,
    LongTable,
    PageTemplate,
    Paragraph,
    Spacer,
    Table,
)

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.present.page import PAPER_DPI, pixels

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tsis.present.page import Card, Page, Picture


rl_config.useA85 = 0  # streams of letters are a quarter longer, and take seconds of Python to write
SANS, BOLD, MONO = "DejaVuSans", "DejaVuSans-Bold", "DejaVuSansMono"  # matplotlib brings them; free to embed
TURNS = frozenset("\u200e\u200f\u061c\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")  # turn text around
RIGHT_TO_LEFT = frozenset({"R", "AL"})
NUMBER = re.compile(r"\d+(?:[.,:/-]\d+)*")
WASTE = 2.0  # wrapping between words takes up to so many times the lines of an unbroken text


@functools.cache
def register_fonts() -> None:
    """Register the fonts with reportlab, once for the process."""
    folder = Path(mpl.get_data_path()) / "fonts" / "ttf"
    for name in (SANS, BOLD, MONO):
        pdfmetrics.registerFont(TTFont(name, folder / f"{name}.ttf"))
    pdfmetrics.registerFontFamily(SANS, normal=SANS, bold=BOLD, italic=SANS, boldItalic=BOLD)


def drawable_text(text: str, font: str = SANS) -> str:
    r"""``text`` as it is drawn: what the font cannot draw, or what turns text around, by its code point.

    Examples
    --------
    >>> drawable_text("4 mm²\t± 1\x07")
    '4 mm² ± 1[U+0007]'
    """
    reference = unicodedata.normalize("NFC", text).replace("\r\n", "\n").replace("\t", " ")
    return "\n".join(_drawable(in_drawn_order(line), font) for line in reference.split("\n"))


def markup(text: str, font: str = SANS) -> str:
    """``text`` as the markup of a reportlab paragraph that shows it and nothing else."""
    return escaped(drawable_text(text, font))


def escaped(drawable: str) -> str:
    """Markup of a text that `drawable_text` returned."""
    return html.escape(drawable, quote=False).replace("\n", "<br/>")


def width(drawable: str, font: str, size: float) -> float:
    """Width in points of the widest line of a text that `drawable_text` returned."""
    return max(float(pdfmetrics.stringWidth(line, font, size)) for line in drawable.split("\n"))


def pieces(drawable: str, font: str, size: float, *, within: float, lines: int) -> Iterator[str]:
    """Cut a text into pieces of which none takes more than ``WASTE * lines`` lines of ``within`` points."""
    piece, used = "", 0.0
    for part in re.findall(r"\n|[^\s]+|[^\S\n]+", drawable):
        need = within if part == "\n" else float(pdfmetrics.stringWidth(part, font, size))
        if used + need > lines * within and piece:
            yield piece
            piece, used = "", 0.0
        while need > lines * within:  # a single long word
            count = max(1, int(len(part) * lines * within / need) // 2)
            yield part[:count]
            part = part[count:]
            need = float(pdfmetrics.stringWidth(part, font, size))
        piece, used = piece + part, used + need
    yield piece


def in_drawn_order(line: str) -> str:
    """Letters from left to right as they are drawn: words that are read from the right are turned around.

    Paper does not do this by itself, as a browser does. It holds for what fits on one line, a name for instance; Arabic
    letters keep their isolated shapes.

    Examples
    --------
    >>> in_drawn_order("phantom \u05d0\u05d1\u05d2 7") == "phantom \u05d2\u05d1\u05d0 7"
    True
    """
    kinds = [unicodedata.bidirectional(letter) for letter in line]
    if not RIGHT_TO_LEFT.intersection(kinds):
        return line
    drawn, start = "", 0
    while start < len(line):
        end = _end_of_run(kinds, start)
        drawn += line[start] if end == start else _visual_order(line[start:end])
        start = max(end, start + 1)
    return drawn


def _end_of_run(kinds: list[str], start: int) -> int:
    """Where what is read from the right ends, without blanks behind it; ``start`` where none begins there."""
    end = start
    if kinds[start] not in RIGHT_TO_LEFT:
        return end
    for index in range(start, len(kinds)):
        if kinds[index] == "L":
            break
        if kinds[index] in RIGHT_TO_LEFT or kinds[index] == "NSM":
            end = index + 1
    return end


def _visual_order(run: str) -> str:
    clusters: list[str] = []
    position = 0
    while position < len(run):
        number = NUMBER.match(run, position)
        if number:
            clusters.append(number.group())
        elif clusters and unicodedata.bidirectional(run[position]) == "NSM":
            clusters[-1] += run[position]  # an accent follows its letter
        else:
            clusters.append(_mirrored(run[position]))
        position = number.end() if number else position + 1
    return "".join(reversed(clusters))


def _mirrored(letter: str) -> str:
    pairs = "()[]{}<>"
    result = pairs.find(letter)
    return letter if result < 0 else pairs[result ^ 1]


def _drawable(line: str, font: str) -> str:
    register_fonts()
    glyphs = pdfmetrics.getFont(font).face.charToGlyph
    return "".join(
        letter if ord(letter) in glyphs and letter not in TURNS else f"[U+{ord(letter):04X}]" for letter in line
    )


INK, SOFT, LINE = HexColor("#1b1f24"), HexColor("#57606a"), HexColor("#d0d7de")
BLUE, WARM, TINT = HexColor("#0072b2"), HexColor("#b34700"), HexColor("#f6f8fa")
PAPER = A4
SIDE, TOP, BOTTOM = 18 * mm, 18 * mm, 20 * mm
WIDTH, HEIGHT = PAPER[0] - 2 * SIDE, PAPER[1] - TOP - BOTTOM
GAP = 4 * mm  # between adjacent blocks
BLOCK_LINES = 40  # of a paragraph; longer texts are split, since the layout time grows faster than the length


def style(size: float, font: str = SANS, **more: Any) -> ParagraphStyle:
    """A paragraph style with the colour, leading and wrapping of the page."""
    register_fonts()
    given: dict[str, Any] = {
        "textColor": INK,
        "leading": 1.3 * size,
        "bulletFontName": font,
        "splitLongWords": 1,
        **more,
    }
    return ParagraphStyle(f"{font}-{size}", fontName=font, fontSize=size, **given)


TITLE = style(17, BOLD, spaceAfter=2)
SUBTITLE = style(9.5, textColor=SOFT, spaceAfter=6)
HEADING = style(11.5, BOLD, spaceBefore=11, spaceAfter=4)
NOTE = style(9, leftIndent=10, spaceAfter=2)
CELL, CELL_HEADING, SMALL = style(7.8), style(7.8, BOLD), style(7.5, textColor=SOFT)
CODE = style(6.3, MONO)


def paragraphs(text: str, kind: ParagraphStyle, *, within: float = WIDTH, **more: Any) -> list[Paragraph]:
    """Paragraphs of any text."""
    whole = drawable_text(text, kind.fontName)
    parts = pieces(whole, kind.fontName, kind.fontSize, within=within, lines=BLOCK_LINES)
    return [Paragraph(escaped(part), kind, **(more if number == 0 else {})) for number, part in enumerate(parts)]


def line(text: str, kind: ParagraphStyle) -> Paragraph:
    """A short text."""
    return Paragraph(markup(text, kind.fontName), kind)


CELL_PADDING = 3.0
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
        ("LEFTPADDING", (0, 0), (-1, -1), CELL_PADDING),
        ("RIGHTPADDING", (0, 0), (-1, -1), CELL_PADDING),
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
        list(pieces(text, kind.fontName, kind.fontSize, within=width - 2 * CELL_PADDING, lines=LINES))
        for text, width in zip(texts, widths, strict=True)
    ]
    return [
        [Paragraph(escaped(parts[index]), kind) if index < len(parts) else "" for parts in cut]
        for index in range(max(map(len, cut)))
    ]


def _widths(names: tuple[str, ...], texts: Rows, cell: ParagraphStyle) -> list[float]:
    around = 2 * CELL_PADDING + ROOM
    columns = list(zip(*texts, strict=True))
    titles = names or ("",) * len(columns)
    ideal, least = [], []
    for name, column in zip(titles, columns, strict=True):
        ideal.append(max(_wide(name, CELL_HEADING), *(_wide(text, cell) for text in column)) + around)
        least.append(max(_word_width(name, CELL_HEADING), *(_word_width(text, cell) for text in column)) + around)
    return column_widths(least, ideal)


def _wide(text: str, kind: ParagraphStyle) -> float:
    return min(width(text, kind.fontName, kind.fontSize), float(WIDTH))


def _word_width(text: str, kind: ParagraphStyle) -> float:
    return min(max((width(part, kind.fontName, kind.fontSize) for part in text.split()), default=0.0), float(WIDTH))


CARDS = 4  # in a row
LONG_CARD, LONG_CAPTION = 200, 400  # letters; longer texts are placed below
VALUE_SIZES = (14, 12, 10, 8.5)
EASE = 1.3  # pictures are drawn larger by this factor: text of 9 points becomes 7
TALLEST, TALLEST_WIDE = 0.32 * HEIGHT, 0.8 * HEIGHT
POINTS = 72.0  # an inch
LEAST_POINTS = 36.0  # a side of a picture
PADDING = 6.0


def cards(given: Sequence[Card]) -> list[Any]:
    """Cards in rows; cards with long texts follow as a table."""
    short = [card for card in given if _longest(card) <= LONG_CARD]
    long = [(card.title, card.value, card.detail) for card in given if _longest(card) > LONG_CARD]
    rows = [_card_row(short[start : start + CARDS], min(CARDS, len(short))) for start in range(0, len(short), CARDS)]
    return [*rows, *(table(("result", "value", "detail"), long) if long else [])]


def _longest(card: Card) -> int:
    return max(len(drawable_text(text)) for text in (card.title, card.value, card.detail))


def _card_row(given: Sequence[Card], count: int) -> Table:
    wide = (WIDTH - (count - 1) * GAP) / count
    cells: list[Any] = []
    looks: list[Any] = [("VALIGN", (0, 0), (-1, -1), "TOP"), *_no_padding()]
    for number, card in enumerate(given):
        position = 2 * number
        cells += [_card(card, wide - 2 * PADDING), ""]
        looks += [
            ("BOX", (position, 0), (position, 0), 0.5, LINE),
            ("LINEBEFORE", (position, 0), (position, 0), 2.5, WARM if card.doubtful else BLUE),
            ("LEFTPADDING", (position, 0), (position, 0), PADDING),
            ("RIGHTPADDING", (position, 0), (position, 0), PADDING),
            ("TOPPADDING", (position, 0), (position, 0), 4),
            ("BOTTOMPADDING", (position, 0), (position, 0), 5),
        ]
    cells = (cells + ["", ""] * count)[: 2 * count - 1]
    widths = [wide if index % 2 == 0 else GAP for index in range(2 * count - 1)]
    return Table([cells], colWidths=widths, style=looks, spaceAfter=GAP)


def _card(card: Card, wide: float) -> list[Paragraph]:
    drawn = drawable_text(_single_line(card.value), BOLD)
    size = next((size for size in VALUE_SIZES if width(drawn, BOLD, size) <= wide), VALUE_SIZES[-1])
    value = style(size, BOLD, textColor=WARM if card.doubtful else BLUE, spaceBefore=1, spaceAfter=2)
    detail = _single_line(card.detail)
    parts = [line(_single_line(card.title), style(8, SANS, textColor=INK)), line(_single_line(card.value), value)]
    return [*parts, *([line(detail, style(7, SANS, textColor=SOFT))] if detail else [])]


def _single_line(text: str) -> str:
    return " ".join(text.split())


def picture_rows(given: Sequence[Picture]) -> list[list[Any]]:
    """Rows of two pictures, or of a wide one, with long captions below the row."""
    rows: list[list[Picture]] = []
    for picture in given:
        if not picture.wide and rows and len(rows[-1]) == 1 and not rows[-1][0].wide:
            rows[-1].append(picture)
        else:
            rows.append([picture])
    return [_picture_row(row) for row in rows]


def _picture_row(row: Sequence[Picture]) -> list[Any]:
    wide = WIDTH if row[0].wide else (WIDTH - GAP) / 2
    drawn = [[_image(picture, wide), Spacer(1, 2), *_caption(picture)] for picture in row]
    spread: list[Any] = drawn if row[0].wide else [drawn[0], "", drawn[1] if len(drawn) > 1 else ""]
    widths = [wide] if row[0].wide else [wide, GAP, wide]
    looks = [("VALIGN", (0, 0), (-1, -1), "TOP"), *_no_padding()]
    below = [part for picture in row for part in _long_caption(picture)]
    return [Table([spread], colWidths=widths, style=looks, spaceAfter=8), *below]


def _image(picture: Picture, wide: float) -> Image:
    tall = TALLEST_WIDE if picture.wide else TALLEST
    size = picture.size[0] * POINTS, picture.size[1] * POINTS
    shrink = min(1.0, EASE * wide / size[0], EASE * tall / size[1])
    drawn = tuple(max(shrink * side, LEAST_POINTS) for side in size)
    scale = min(wide / drawn[0], tall / drawn[1], 1.0)
    content = pixels(picture, size=(drawn[0] / POINTS, drawn[1] / POINTS), dpi=PAPER_DPI * scale, compress_level=0)
    return Image(io.BytesIO(content), width=scale * drawn[0], height=scale * drawn[1], hAlign="LEFT")


def _alternative_text(picture: Picture) -> str:
    """Caption and alternative text, which paper shows both."""
    parts = {_with_full_stop(part): None for part in (picture.caption, picture.alt) if part.strip()}
    return " ".join(part for part in parts if part != _with_full_stop(picture.title))


def _with_full_stop(text: str) -> str:
    message = _single_line(text)
    return message if message.endswith((".", "!", "?")) else f"{message}."


def _long(text: str) -> bool:
    return len(drawable_text(text)) > LONG_CAPTION


def _caption(picture: Picture) -> list[Paragraph]:
    title, text = _with_full_stop(picture.title), _alternative_text(picture)
    heading = "Named below." if _long(title) else title
    message = "Described below." if _long(text) else text
    return [Paragraph(f'<font name="{BOLD}" color="#1b1f24">{markup(heading, BOLD)}</font> {markup(message)}', SMALL)]


def _long_caption(picture: Picture) -> list[Paragraph]:
    messages = [text for text in (_with_full_stop(picture.title), _alternative_text(picture)) if _long(text)]
    return [part for text in messages for part in paragraphs(text, SMALL)]


def provenance(given: Mapping[str, Any]) -> list[Any]:
    """Names and values in small monospaced text, nested ones by path."""
    return table((), [(name, value) for name, value in leaves(given)], cell=CODE)


def leaves(value: Any, path: str = "") -> list[tuple[str, str]]:
    """Nested mappings and sequences as paths with their values; the plain values of a mapping share a text.

    Examples
    --------
    >>> leaves({"images": [{"name": "a", "force_n": 1.0, "settings": {"gain": 2}}], "forces": [1.0, 2.0]})
    [('images[0]', 'name: a; force_n: 1.0'), ('images[0].settings', 'gain: 2'), ('forces', '1.0, 2.0')]
    """
    if isinstance(value, Mapping):
        reference = {name: inner for name, inner in value.items() if path and not _nested(inner)}
        below = [(f"{path}.{name}" if path else str(name), value[name]) for name in value if name not in reference]
        own = [(path, _value_text(reference))] if reference or not below else []
        return [*own, *(leaf for name, inner in below for leaf in leaves(inner, name))]
    if _listed(value) and any(_nested(inner) or _listed(inner) for inner in value):
        return [leaf for index, inner in enumerate(value) for leaf in leaves(inner, f"{path}[{index}]")]
    return [(path, _value_text(value))]


def _value_text(value: Any) -> str:
    if isinstance(value, Mapping):
        return "; ".join(f"{name}: {_value_text(inner)}" for name, inner in value.items()) or "none"
    return (", ".join(str(inner) for inner in value) or "none") if _listed(value) else str(value)


def _listed(value: Any) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str | bytes)


def _nested(value: Any) -> bool:
    """Whether a value contains nested values."""
    return isinstance(value, Mapping) or (_listed(value) and any(isinstance(x, Mapping) or _listed(x) for x in value))


def _no_padding() -> list[Any]:
    """Cells without a border, and an embedded font for empty cells, whose default is not in the file."""
    return [
        ("FONTNAME", (0, 0), (-1, -1), SANS),
        *((f"{side}PADDING", (0, 0), (-1, -1), 0) for side in ("LEFT", "RIGHT", "TOP", "BOTTOM")),
    ]


TOTAL = "total"  # name of the form with the number of sheets
FOOT, FOOT_SIZE = 12.0 * 72 / 25.4, 7.0
LONGEST_NAME = 200  # letters of a heading in bookmarks and of the title in a reader's title bar
AFTER_HEADING = 60.0  # least space below a heading, points
NOTICE = SUBTITLE.clone(
    "notice",
    fontName=BOLD,
    fontSize=9,
    leading=12,
    alignment=1,
    textColor="white",
    backColor=WARM,
    borderPadding=3,
    spaceAfter=10,
)
_LAYOUT_LOCK = threading.Lock()  # fonts are one for the process, and reportlab reads their files while it writes


def pdf_bytes(page: Page) -> bytes:
    """The page as a PDF file; equal pages give equal bytes.

    What the embedded fonts (DejaVu) cannot show is written as its code point, such as ``[U+4E2D]``. A word that is read
    from the right is reversed as in a browser, if it fits on one line.
    """
    buffer = io.BytesIO()
    with _LAYOUT_LOCK:
        register_fonts()
        _Sheets(buffer, title=_short_line(page.title), subject=_short_line(page.subtitle)).build(
            _story(page), canvasmaker=_CountedCanvas
        )
    return buffer.getvalue()


def _story(page: Page) -> list[Any]:
    story: list[Any] = [
        Paragraph(RESEARCH_USE_ONLY, NOTICE),
        *paragraphs(page.title, TITLE),
        *paragraphs(page.subtitle, SUBTITLE),
    ]
    story += cards(page.cards)
    if page.notes:
        notes = [part for note in page.notes for part in paragraphs(note, NOTE, bulletText="•")]
        story += _section("What to know about this result", notes)
    if page.refused:
        story += _section("Not estimated, and why", table(("Estimate", "What is missing"), page.refused))
    if page.pictures:
        rows = picture_rows(page.pictures)
        story += _section("Pictures", rows[0], room=rows[0][0].wrap(WIDTH, HEIGHT)[1])
        story += [part for row in rows[1:] for part in row]
    for item in page.tables:
        story += _section(item.title, table(item.headings, item.rows))
    if page.provenance:
        story += _section("Provenance", provenance(page.provenance))
    return story


def _section(title: str, content: Sequence[Any], *, room: float = AFTER_HEADING) -> list[Any]:
    """A heading that is never alone at the foot of a sheet."""
    return [CondPageBreak(min(room + 3 * HEADING.leading, HEIGHT)), *_headings(title), *content]


def _headings(title: str) -> list[Any]:
    parts = paragraphs(title, HEADING)
    parts[0].bookmark = _short_line(title)
    return parts


def _short_line(text: str) -> str:
    return drawable_text(" ".join(text[: 2 * LONGEST_NAME].split()))[:LONGEST_NAME]


class _Sheets(BaseDocTemplate):  # type: ignore[misc]  # reportlab has no types
    """A4 sheets with the title above all but the first, and the notice below."""

    def __init__(self, target: io.BytesIO, *, title: str, subject: str) -> None:
        super().__init__(
            target,
            pagesize=PAPER,
            title=title,
            subject=f"{subject}. {RESEARCH_USE_ONLY}" if subject else RESEARCH_USE_ONLY,
            author="",
            creator=f"tsis {__version__}",
            producer="ReportLab",
            lang="en",
            displayDocTitle=1,
            initialFontName=SANS,  # else the file names a font that is not embedded
            invariant=1,
        )
        self.heading = title
        frame = Frame(SIDE, BOTTOM, WIDTH, HEIGHT, leftPadding=0, rightPadding=0, topPadding=0, bottomPadding=0)
        self.addPageTemplates(PageTemplate(frames=[frame], onPage=_margins))

    def afterFlowable(self, flowable: Any) -> None:  # noqa: N802  # the name is reportlab's
        """Bookmarks of headings."""
        title = getattr(flowable, "bookmark", None)
        if title is not None:
            key = f"section-{self.page}-{self.frame._y:.0f}"
            self.canv.bookmarkPage(key, fit="XYZ", top=self.frame._y + 2 * HEADING.leading, left=0, zoom=0)
            self.canv.addOutlineEntry(title or "Section", key, level=0)


def _margins(canvas: Canvas, sheets: _Sheets) -> None:
    canvas.saveState()
    canvas.setFillColor(SOFT)
    canvas.setStrokeColor(LINE)
    canvas.setLineWidth(0.5)
    canvas.setFont(SANS, FOOT_SIZE)
    canvas.line(SIDE, FOOT + 9, SIDE + WIDTH, FOOT + 9)
    canvas.drawString(SIDE, FOOT, RESEARCH_USE_ONLY)
    total = width("00", SANS, FOOT_SIZE)
    canvas.drawRightString(SIDE + WIDTH - total, FOOT, f"tsis {__version__}, page {sheets.page} of ")
    canvas.translate(SIDE + WIDTH - total, FOOT)
    canvas.doForm(TOTAL)
    canvas.translate(-(SIDE + WIDTH - total), -FOOT)
    if sheets.page > 1:
        canvas.drawString(SIDE, PAPER[1] - 0.65 * TOP, _cut(sheets.heading))
    canvas.restoreState()


def _cut(title: str) -> str:
    """As much of the title as fits above a sheet."""
    if width(title, SANS, FOOT_SIZE) <= WIDTH:
        return title
    count = next(count for count in range(len(title), 0, -1) if width(f"{title[:count]}…", SANS, FOOT_SIZE) <= WIDTH)
    return f"{title[:count]}…"


class _CountedCanvas(Canvas):  # type: ignore[misc]  # reportlab has no types
    """Writes the number of sheets at the end, into the form that every foot refers to."""

    def save(self) -> None:
        """Write the number of sheets, then the file."""
        sheets = self.getPageNumber() - 1
        self.beginForm(TOTAL, 0, -FOOT_SIZE, PAPER[0], 2 * FOOT_SIZE)
        self.setFillColor(SOFT)
        self.setFont(SANS, FOOT_SIZE)
        self.drawString(0, 0, str(sheets))
        self.endForm()
        super().save()
