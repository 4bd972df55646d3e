"""The way to the other pages, and where one is: for the eye, for readers of the screen, in the tab's title."""

from __future__ import annotations

from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from nicegui import ui

from tsis.console.pages.directory import PAGES

if TYPE_CHECKING:
    from nicegui.elements.label import Label

NOWHERE = "No such page"


class Navigation:
    """Links to the pages, of which the one that is open is marked."""

    def __init__(self) -> None:
        router = ui.context.client.sub_pages_router
        self._heading: Label | None = None
        with ui.element("nav").props('aria-label="Pages"').classes("tabs"):
            self._links = {
                address: ui.link(title, address).classes("tab")
                for address, (title, _) in PAGES.items()
                if "{" not in address
            }
        self._path = router.current_path
        router.on_path_changed(self._moved)
        self._mark()

    def heading(self) -> None:
        """The page's first heading: readers of the screen begin with it, the eye has the marked link."""
        self._heading = ui.label(title_of(self._path)).props('role="heading" aria-level="1"').classes("unseen")

    def _moved(self, path: str) -> None:
        self._path = path
        self._mark()
        if self._heading is not None:
            self._heading.text = title_of(path)

    def _mark(self) -> None:
        here = address_of(self._path)
        for address, link in self._links.items():
            if address == here:
                link.classes(add="here").props('aria-current="page"')
            else:
                link.classes(remove="here").props(remove="aria-current")
        ui.page_title(f"{title_of(self._path)} · tsis console")


def address_of(path: str) -> str:
    """The address in the navigation that a path belongs to: of ``/records/7?x=1`` it is ``/records``."""
    return "/" + urlsplit(path).path.strip("/").partition("/")[0]


def title_of(path: str) -> str:
    """What the page of a path is called."""
    return PAGES[address_of(path)][0] if address_of(path) in PAGES else NOWHERE
