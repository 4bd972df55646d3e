"""Sizes, colours and paragraphs of a report on paper."""

from __future__ import annotations

from typing import Any

from reportlab.lib.colors import HexColor
from reportlab.lib.pagesizes import A4
from reportlab.lib.styles import ParagraphStyle
from reportlab.lib.units import mm
from reportlab.platypus import Paragraph

from tsis.report.paper_text import BOLD, MONO, SANS, drawable_text, escaped, markup, pieces, register_fonts

INK, SOFT, LINE = HexColor("#1b1f24"), HexColor("#57606a"), HexColor("#d0d7de")
BLUE, WARM, TINT = HexColor("#0072b2"), HexColor("#b34700"), HexColor("#f6f8fa")
PAPER = A4
SIDE, TOP, BOTTOM = 18 * mm, 18 * mm, 20 * mm
WIDTH, HEIGHT = PAPER[0] - 2 * SIDE, PAPER[1] - TOP - BOTTOM
GAP = 4 * mm  # between what stands side by side
BLOCK_LINES = 40  # of a paragraph; a longer text becomes several, since laying out one costs more than its length


def style(size: float, font: str = SANS, **more: Any) -> ParagraphStyle:
    """A paragraph's style with the page's colour, leading and wrapping."""
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
    """A text of any length and any letters in paragraphs."""
    whole = drawable_text(text, kind.fontName)
    parts = pieces(whole, kind.fontName, kind.fontSize, within=within, lines=BLOCK_LINES)
    return [Paragraph(escaped(part), kind, **(more if number == 0 else {})) for number, part in enumerate(parts)]


def line(text: str, kind: ParagraphStyle) -> Paragraph:
    """A short text."""
    return Paragraph(markup(text, kind.fontName), kind)
