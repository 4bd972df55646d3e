"""Parts of a report on a page of the console: the same cards, pictures and tables as in its file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.headings import panel_title
from tsis.console.pages.table import row, rows_under
from tsis.report.drawing import address

if TYPE_CHECKING:
    from collections.abc import Iterable

    from nicegui.element import Element

    from tsis.report.page import Card, Page, Picture, Table


def drawings(page: Page) -> tuple[str, ...]:
    """The figures of a page as data addresses, in their order; drawing takes a while, so not in the event loop."""
    return tuple(address(picture) for picture in page.pictures)


def report_parts(page: Page, sources: Iterable[str]) -> None:
    """Show a whole report: cards, what to know, pictures as `drawings` made them ready, tables."""
    cards(page.cards)
    for note in page.notes:
        ui.label(note).classes("muted")
    with ui.element("div").classes("grid"):
        for picture, source in zip(page.pictures, sources, strict=True):
            figure(picture, source)
    for each in page.tables:
        table(each)


def cards(found: Iterable[Card]) -> None:
    """The numbers that the reader came for."""
    with ui.element("div").classes("cards"):
        for card in found:
            with ui.element("div").classes("card doubtful" if card.doubtful else "card"):
                ui.label(card.title).classes("muted")
                ui.label(card.value).classes("number")
                ui.label(card.detail).classes("muted")


def figure(picture: Picture, source: str) -> None:
    """A figure, drawn before, with its caption, and words for those who do not see it."""
    with ui.element("figure").classes("plot wide" if picture.wide else "plot"):
        panel_title(picture.title, level=3)
        show_drawing(drawing(), source, picture.alt)
        if picture.caption:
            with ui.element("figcaption").classes("muted"):
                ui.label(picture.caption)


def drawing() -> Element:
    """A place for drawings: inside the page, the names of a drawing's parts would be those of every other's."""
    return ui.element("img").classes("drawing")


def show_drawing(image: Element, source: str, alt: str) -> None:
    """Show a drawing, of this data address, in a place for drawings."""
    image.props["src"], image.props["alt"] = source, alt


def table(found: Table) -> None:
    """Rows of text under headings."""
    with ui.element("section"):
        panel_title(found.title, level=3)
        with ui.element("div").classes("scroll"), rows_under(found.headings):
            for each in found.rows:
                row(each)
