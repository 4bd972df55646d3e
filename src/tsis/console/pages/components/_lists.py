"""Titles, lists, tables, cards and figures of all pages."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.present.page import address

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence
    from typing import Any

    from nicegui.element import Element
    from nicegui.elements.label import Label

    from tsis.present.page import Card, Page, Picture, Table


def set_class(element: Element, name: str, present: bool) -> None:
    """Add a class to an element, or remove it."""
    element.classes(add=name) if present else element.classes(remove=name)


def panel_title(text: str, *, level: int = 2) -> Label:
    """The title of a panel."""
    title = ui.label(text).classes("panel-title").props("role=heading")
    title.props["aria-level"] = level
    return title


@contextmanager
def panel(title: str, *, style: str = "panel stack") -> Iterator[Element]:
    """A panel under its title."""
    with ui.element("section").classes(style) as place:
        panel_title(title)
        yield place


@contextmanager
def title_row(title: str, *, level: int = 2) -> Iterator[None]:
    """A line with a title at its left; what is made in it stands at its right."""
    with ui.element("div").classes("row"):
        panel_title(title, level=level)
        ui.element("div").classes("spring")
        yield


def muted(text: str = "") -> Label:
    """A label that says less than others."""
    return ui.label(text).classes("muted")


def status(style: str = "muted") -> Label:
    """A label whose changes readers of the screen say."""
    return ui.label().classes(style).props("role=status")


def button(
    text: str,
    act: Callable[..., object] | None = None,
    *,
    icon: str | None = None,
    look: str = "outline",
    label: str = "",
) -> ui.button:
    """A button; its look is ``"unelevated"`` for the next step; ``label`` is what readers of the screen say."""
    made = ui.button(text, icon=icon, on_click=act)
    for word in look.split():
        made.props[word] = True
    if label:
        made.props["aria-label"] = label
    return made


@contextmanager
def titled_dialog(title: str, *, style: str = "dialog-card", opened: bool = False) -> Iterator[ui.dialog]:
    """A dialog that screen readers know by its title."""
    with ui.dialog(value=opened) as dialog, ui.card().classes(style):
        dialog.props["aria-label"] = title
        panel_title(title)
        yield dialog


@contextmanager
def open_dialog(place: Element, title: str, *, style: str = "dialog-card") -> Iterator[ui.dialog]:
    """Open a dialog in a place of the page; it is deleted when it is closed."""
    with place, titled_dialog(title, style=style, opened=True) as dialog:
        yield dialog
    dialog.on("hide", dialog.delete)


def dialog_buttons(dialog: ui.dialog, text: str, act: Callable[[], object], *, leave: str = "Cancel") -> ui.button:
    """Place the button of a dialog, which is returned, and the one that closes it."""
    with ui.element("div").classes("row"):
        made = button(text, act, look="unelevated dense")
        button(leave, dialog.close, look="flat dense")
    return made


async def is_confirmed(question: str, *, yes: str, why: str) -> bool:
    """Ask for confirmation; False without a response."""
    with titled_dialog(question, style="question") as dialog:
        ui.label(why).classes("muted")
        with ui.element("div").classes("row"):
            ui.element("div").classes("spring")
            button("Cancel", lambda: dialog.submit(False), look="flat")
            button(yes, lambda: dialog.submit(True), look="unelevated")
    response = bool(await dialog)
    dialog.delete()
    return response


class Redrawn:
    """A part of a page that is drawn anew when its content changes; it replaces whatever is in the element."""

    def __init__(self, element: Element) -> None:
        self.element = element
        self.content: object = None

    def changes_to(self, content: object) -> bool:
        """Whether the content is a new one; the element is emptied then."""
        if content == self.content:
            return False
        self.content = content
        self.element.clear()
        return True


class FactList:
    """A list of terms with their values; empty at first."""

    def __init__(self) -> None:
        self._list = Redrawn(ui.element("dl").classes("facts"))

    def show(self, facts: Iterable[tuple[str, str]]) -> None:
        """Show these facts in place of those before."""
        facts = tuple(facts)
        if not self._list.changes_to(facts):
            return
        with self._list.element:
            for term, value in facts:
                with ui.element("dt"):
                    ui.label(term)
                with ui.element("dd"):
                    ui.label(value)


def message_list(messages: Iterable[str] = ()) -> Element:
    """Place a list with these messages; others can be `list_message` in it."""
    with ui.element("ul").classes("sentences") as position:
        for message in messages:
            list_message(message)
    return position


def list_message(message: str, style: str = "") -> None:
    """Place a message in a list."""
    with ui.element("li"):
        ui.label(message).classes(style)


def rows_under(headings: Iterable[str], *, caption: str = "", label: str = "", style: str = "table") -> Element:
    """Place a table, its ``label`` unseen; what is made in what this gives becomes its rows."""
    with ui.element("table").classes(style) as table:
        if label:
            table.props["aria-label"] = label
        if caption:
            with ui.element("caption"):
                ui.label(caption)
        with ui.element("thead"), ui.element("tr"):
            for heading in headings:
                with ui.element("th").props("scope=col") if heading else ui.element("td"):
                    ui.label(heading)
        return ui.element("tbody")


def row(cells: Iterable[str]) -> None:
    """Place a row of text."""
    with ui.element("tr"):
        for text in cells:
            cell(text)


COUNTED = {"press": ("1 press", "{count} presses"), "target": ("1 target", "{count} targets")}


def count_text(number: int, what: str) -> str:
    """So many presses or targets.

    Examples
    --------
    >>> count_text(1, "press"), count_text(2, "target")
    ('1 press', '2 targets')
    """
    return COUNTED[what][number != 1].format(count=number)


def cell(text: str) -> ui.label:
    """Place a cell with a text."""
    with ui.element("td"):
        return ui.label(text)


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
    for item in page.tables:
        table(item)


def cards(items: Iterable[Card]) -> None:
    """The main numbers of a report."""
    with ui.element("div").classes("cards"):
        for card in items:
            with ui.element("div").classes("card doubtful" if card.doubtful else "card"):
                ui.label(card.title).classes("muted")
                ui.label(card.value).classes("number")
                ui.label(card.detail).classes("muted")


def figure(picture: Picture, source: str) -> None:
    """A drawn figure with its caption, and a text for screen readers."""
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


def table(content: Table) -> None:
    """Rows of text under headings."""
    with ui.element("section"):
        panel_title(content.title, level=3)
        with ui.element("div").classes("scroll"), rows_under(content.headings):
            for item in content.rows:
                row(item)


def sheets_of_targets(table: ui.table, sizes: Sequence[int], pages: Callable[[], dict[str, Any]]) -> None:
    """Have a table show one sheet of many targets: ``pages`` is its pagination, whatever a slow browser has sent."""

    def restore() -> None:
        if table.pagination != pages():
            table.pagination = pages()

    table.props("flat dense wrap-cells").classes("targets")
    table.props["rows-per-page-label"], table.props["rows-per-page-options"] = "Targets on a sheet", list(sizes)
    table.on_pagination_change(restore)
