"""Tables by hand, for rows that hold more than text or come one after the other."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

if TYPE_CHECKING:
    from collections.abc import Iterable

    from nicegui.element import Element


def rows_under(headings: Iterable[str], *, caption: str = "", label: str = "", look: str = "table") -> Element:
    """Place a table, its ``label`` unseen; what is made in what this gives becomes its rows."""
    with ui.element("table").classes(look) as table:
        if label:
            table.props["aria-label"] = label
        if caption:
            with ui.element("caption"):
                ui.label(caption)
        with ui.element("thead"), ui.element("tr"):
            for heading in headings:
                with ui.element("th").props("scope=col"):
                    ui.label(heading)
        return ui.element("tbody")


def row(cells: Iterable[str]) -> None:
    """Place a row of text."""
    with ui.element("tr"):
        for text in cells:
            cell(text)


def cell(text: str) -> ui.label:
    """Place a cell with a text."""
    with ui.element("td"):
        return ui.label(text)
