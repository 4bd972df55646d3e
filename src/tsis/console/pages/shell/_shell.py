"""The frame of every page: navigation, colours, header and footer."""

from __future__ import annotations

import logging
from functools import partial
from typing import TYPE_CHECKING, Final
from urllib.parse import urlsplit

from nicegui import ui
from nicegui.element import Element
from nicegui.translations import translations

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.console.auth import LOGOUT
from tsis.console.pages import PAGES, UNLISTED
from tsis.console.pages.components import StatePoller, Tabs, Viewer
from tsis.console.pages.jobs import JobList
from tsis.console.pages.shell._control import ControlButtons, Notices, PageVisibility

if TYPE_CHECKING:
    from nicegui.elements.label import Label

    from tsis.console.services import Instrument, InstrumentState


REMEMBERED = "tsis-colours"  # key in the browser's local storage; theme.js has it too
AT_ONCE = f"""<script>
(() => {{
  let chosen = null;
  try {{ chosen = localStorage.getItem("{REMEMBERED}"); }} catch {{ /* storage is refused: as the system has it */ }}
  const dark = chosen === "dark" || (chosen !== "light" && matchMedia("(prefers-color-scheme: dark)").matches);
  document.documentElement.classList.toggle("dark", dark);
}})();
</script>"""
"""Colours the page before anything is on it, so that a dark room sees no white flash."""


class ThemeChoice(Element, component="theme.js"):
    """A button that goes through light, dark and as the system has it."""


_log = logging.getLogger(__name__)


class Subpages(ui.sub_pages):
    """Pages by address; an address without a page, or a page that fails, gives a message and a link."""

    def _render_404(self) -> None:
        _instead("There is no page at this address. The links above lead to all there are.")

    def _render_error(self, _: Exception) -> None:
        _log.exception("a page could not be built")
        _instead("This page could not be built. Saved data are safe; the other pages work. Load it again.")


def _instead(message: str) -> None:
    with ui.element("section").classes("panel"):
        ui.label(message)
        ui.link("To the live image", "/")


LANGUAGE: Final = "en-GB"
LOST_CONNECTION = {
    "connection_lost": "The connection to the console is lost.",
    "trying_to_reconnect": "Trying again; nothing on this page works until it is back. Saved data are safe. Where the "
    "console itself was ended, its sequences and jobs were too.",
    "message_too_long": "This was too much for one message.",
    "message_too_long_body": "It was not done. Try again with less of it.",
}


def set_lost_connection_text() -> None:
    """Replace the texts of the pages' library, in every page from now on."""
    translations[LANGUAGE] = {**translations["en-US"], **LOST_CONNECTION}


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
                if "{" not in address and address not in UNLISTED
            }
        self._path = router.current_path
        router.on_path_changed(self._navigated)
        self._mark()

    def heading(self) -> None:
        """The page's first heading: readers of the screen begin with it, the eye has the marked link."""
        self._heading = ui.label(title_of(self._path)).props('role="heading" aria-level="1"').classes("unseen")

    def _navigated(self, path: str) -> None:
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
    """Title of a path's page."""
    return PAGES[address_of(path)][0] if address_of(path) in PAGES else NOWHERE


OPEN_EVERY_S = 2.0  # between two reports that a page is still open
MAIN = "page"  # identity of the element that holds the page, for the link that skips to it


class Shell:
    """Builds the page of every tab of a console."""

    def __init__(self, instrument: Instrument) -> None:
        self._instrument, self._poller, self._tabs = instrument, StatePoller(instrument), Tabs()

    def build(self) -> None:
        """Build the page of the tab that opens now."""
        viewer = Viewer(ui.context.client, self._instrument, self._poller, self._tabs)
        if viewer.logged_in:
            viewer.operator = viewer.name
        with ui.header(elevated=False).classes("bar"):
            ui.link("Skip to the page", f"#{MAIN}").classes("skip")
            ui.label("tsis").classes("brand")
            navigation = Navigation()
            ui.element("div").classes("spring")
            camera = ui.label().classes("chip").mark("camera state")
            jobs = JobList(self._instrument, viewer)
            control = ControlButtons(self._instrument, viewer)
            ThemeChoice()
        notices = Notices(viewer)
        with ui.element("div").classes("content").props(f'id="{MAIN}" tabindex="-1"'):
            navigation.heading()
            Subpages({address: partial(build, self._instrument, viewer) for address, (_, build) in PAGES.items()})
        with ui.footer(elevated=False).classes("foot"):
            ui.label(RESEARCH_USE_ONLY)
            if viewer.logged_in:
                with ui.element("form").props(f'method="post" action="{LOGOUT}"').classes("logout"):
                    ui.label(f"You are in as {viewer.name}.")
                    with ui.element("button").props('type="submit"'):
                        ui.label("Log out")
        PageVisibility(viewer)

        def show(now: InstrumentState) -> None:
            camera.text = _camera_text(now)
            camera.classes(replace="chip bad" if now.camera.lost else "chip")
            jobs.show(now)
            control.show(now)
            notices.show(now)

        viewer.follow(show)
        ui.timer(OPEN_EVERY_S, control.report_open)


def _camera_text(state: InstrumentState) -> str:
    camera = state.camera
    if state.busy:
        return f"{state.busy} …"
    if not camera.running:
        return "camera stopped"
    if camera.lost:
        return "camera away"
    return f"{camera.frames_per_s:.0f} frames/s, {camera.missed} dropped"
