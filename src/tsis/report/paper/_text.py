"""Text on paper: embedded fonts, missing glyphs, and right-to-left text."""

from __future__ import annotations

import functools
import html
import re
import unicodedata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
from reportlab.lib.colors import HexColor
from reportlab.lib.pagesizes import A4
from reportlab.lib.styles import ParagraphStyle
from reportlab.lib.units import mm
from reportlab.pdfbase import pdfmetrics
from reportlab.pdfbase.ttfonts import TTFont
from reportlab.platypus import Paragraph

if TYPE_CHECKING:
    from collections.abc import Iterator


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
    given = pdfmetrics.getFont(font).face.charToGlyph
    return "".join(
        letter if ord(letter) in given and letter not in TURNS else f"[U+{ord(letter):04X}]" for letter in line
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
