"""A page as a PDF file for paper and archives: A4, fonts embedded, the notice and a page number on every sheet."""

from __future__ import annotations

import io
import threading
from typing import TYPE_CHECKING, Any

from reportlab.pdfgen.canvas import Canvas
from reportlab.platypus import BaseDocTemplate, CondPageBreak, Frame, PageTemplate, Paragraph

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.report.paper import _parts as paper_parts
from tsis.report.paper._table import table
from tsis.report.paper._text import (
    BOLD,
    BOTTOM,
    HEADING,
    HEIGHT,
    LINE,
    NOTE,
    PAPER,
    SANS,
    SIDE,
    SOFT,
    SUBTITLE,
    TITLE,
    TOP,
    WARM,
    WIDTH,
    drawable_text,
    paragraphs,
    register_fonts,
    width,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.report._page import Page


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


def pdf(page: Page) -> bytes:
    """The page as a PDF file; equal pages give equal bytes.

    What the embedded fonts (DejaVu) cannot show is written as its code point, such as ``[U+4E2D]``. A word that is read
    from the right is reversed as in a browser, if it fits on one line.
    """
    buffer = io.BytesIO()
    with _LAYOUT_LOCK:
        register_fonts()
        _Sheets(buffer, title=_single_line(page.title), subject=_single_line(page.subtitle)).build(
            _story(page), canvasmaker=_CountedCanvas
        )
    return buffer.getvalue()


def _story(page: Page) -> list[Any]:
    story: list[Any] = [
        Paragraph(RESEARCH_USE_ONLY, NOTICE),
        *paragraphs(page.title, TITLE),
        *paragraphs(page.subtitle, SUBTITLE),
    ]
    story += paper_parts.cards(page.cards)
    if page.notes:
        notes = [part for note in page.notes for part in paragraphs(note, NOTE, bulletText="•")]
        story += _section("What to know about this result", notes)
    if page.refused:
        story += _section("Not estimated, and why", table(("Estimate", "What is missing"), page.refused))
    if page.pictures:
        rows = paper_parts.picture_rows(page.pictures)
        story += _section("Pictures", rows[0], room=rows[0][0].wrap(WIDTH, HEIGHT)[1])
        story += [part for row in rows[1:] for part in row]
    for item in page.tables:
        story += _section(item.title, table(item.headings, item.rows))
    if page.provenance:
        story += _section("Provenance", paper_parts.provenance(page.provenance))
    return story


def _section(title: str, content: Sequence[Any], *, room: float = AFTER_HEADING) -> list[Any]:
    """A heading that is never alone at the foot of a sheet."""
    return [CondPageBreak(min(room + 3 * HEADING.leading, HEIGHT)), *_headings(title), *content]


def _headings(title: str) -> list[Any]:
    parts = paragraphs(title, HEADING)
    parts[0].bookmark = _single_line(title)
    return parts


def _single_line(text: str) -> str:
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
