"""The frame of every page: navigation, colours, header and footer."""

from __future__ import annotations

import logging
import threading
from contextlib import contextmanager, suppress
from functools import partial
from typing import TYPE_CHECKING, Final

from nicegui import ui
from nicegui.element import Element
from nicegui.translations import translations

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.console import widgets
from tsis.console.auth import LOGOUT
from tsis.console.live.hub import FIRST_MAP, packed_colours
from tsis.console.pages import GROUPS, PAGES, load_pages
from tsis.console.pages.examine import SHORTCUTS
from tsis.console.pages.jobs import JobList
from tsis.console.viewer import StatePoller, Tabs, Viewer
from tsis.errors import ControlError, TsisError
from tsis.present.page import Picture, address
from tsis.virtual.camera import load_exposure

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.figure import Figure
    from nicegui.events import GenericEventArguments, KeyEventArguments

    from tsis.console.services.control import Owner
    from tsis.console.services.instrument import Instrument
    from tsis.console.services.state import InstrumentState


REMEMBERED = "tsis-colours"  # key in the browser's local storage; theme.js has it too
AT_ONCE = f"""<script>
(() => {{
  let chosen = null;
  try {{ chosen = localStorage.getItem("{REMEMBERED}"); }} catch {{ /* storage is refused: as the system has it */ }}
  const dark = chosen === "dark" || (chosen !== "light" && matchMedia("(prefers-color-scheme: dark)").matches);
  document.documentElement.classList.toggle("dark", dark);

  let here = [];
  const note = () => {{ here = [history.state, location.href]; }};
  document.addEventListener("focusin", note);
  addEventListener("popstate", (event) => {{
    const dialog = [...document.querySelectorAll(".q-dialog")].at(-1);
    if (!dialog || !here[1]) return note();
    event.stopImmediatePropagation();
    history.pushState(here[0], "", here[1]);
    if (!dialog.querySelector("input:not([type=checkbox]), textarea"))
      dialog.querySelector(".q-dialog__backdrop").click();
  }});
}})();
</script>"""
"""Runs before the page: colours it, so that a dark room sees no white flash, and minds the browser's Back. With an open
dialog, Back stays on the page: it closes the dialog, or changes nothing where that has a field with a text to lose."""


class ThemeChoice(Element, component="theme.js"):
    """A button that goes through light, dark and as the system has it."""


_log = logging.getLogger(__name__)


class Subpages(ui.sub_pages):
    """Pages by address; an address without a page, or a page that fails, gives a message and a link."""

    def _render_404(self) -> None:
        _instead("There is no page at this address. Use the links above.")

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
    "trying_to_reconnect": "Reconnecting; the page does not respond until then. Saved data are safe. If the console "
    "itself was stopped, its sequences and jobs were stopped too.",
    "message_too_long": "The message is too long.",
    "message_too_long_body": "Nothing was changed. Try again with less text.",
}


def set_lost_connection_text() -> None:
    """Replace the texts of the pages' library, in every page from now on."""
    translations[LANGUAGE] = {**translations["en-US"], **LOST_CONNECTION}


NOWHERE = "No such page"


class Navigation:
    """Links to the groups of pages in the header, and to the pages of the group that is open above the page."""

    def __init__(self) -> None:
        router = ui.context.client.sub_pages_router
        self._path = router.current_path
        with ui.element("nav").props('aria-label="Groups of pages"').classes("tabs"):
            self._groups = {group: ui.link(group, pages[0]).classes("tab") for group, pages in GROUPS.items()}
        router.on_path_changed(self._navigated)

    def pages(self) -> None:
        """Place the links to the pages of the group, and the page's first heading, which the eye has in the link."""
        self._nav = ui.element("nav").classes("tabs of-group")
        self._heading = ui.label().props('role="heading" aria-level="1"').classes("unseen")
        self._navigated(self._path)

    def _navigated(self, path: str) -> None:
        here = widgets.address_of(path)
        group = next((name for name, pages in GROUPS.items() if here in pages), "")
        for name, link in self._groups.items():
            _mark(link, name == group)
        self._nav.clear()
        self._nav.props["aria-label"] = f"Pages of {group}"
        pages = GROUPS.get(group, ())
        self._nav.set_visibility(len(pages) > 1)
        with self._nav:
            for address in pages:
                _mark(ui.link(PAGES[address][0], address).classes("tab"), address == here)
        self._heading.text = title_of(path)
        ui.page_title(f"{title_of(path)} · tsis console")


def _mark(link: ui.link, here: bool) -> None:
    if here:
        link.classes(add="here").props('aria-current="page"')
    else:
        link.classes(remove="here").props(remove="aria-current")


def title_of(path: str) -> str:
    """Title of a path's page."""
    return PAGES[widgets.address_of(path)][0] if widgets.address_of(path) in PAGES else NOWHERE


class Notices:
    """The banner below the header; empty without problems."""

    def __init__(self, instrument: Instrument, viewer: Viewer) -> None:
        self._instrument, self._viewer = instrument, viewer
        self._trouble = widgets.Redrawn(ui.element("div").classes("banner").props('role="alert"').mark("banner"))
        self._calm = widgets.Redrawn(ui.element("div").classes("banner").props('role="status"').mark("watching"))

    def show(self, now: InstrumentState) -> None:
        """Show changes only."""
        if self._trouble.changes_to(now.trouble):
            with self._trouble.element:
                for message in now.trouble:
                    with ui.element("div").classes("calm" if message in now.good_news else ""):
                        ui.label(message)
                        if message in now.notices:
                            close = partial(self._viewer.attempt, self._instrument.close_notice, message)
                            widgets.button("Close", close, look="flat dense", label=f"Close: {message}")
        other = now.owner is not None and now.owner.identity != self._viewer.identity
        if self._calm.changes_to(now.owner if other else None) and now.owner is not None and other:
            with self._calm.element:
                ui.label(f"{now.owner.name} controls the camera; you are watching.").classes("calm")


class PageVisibility(Element, component="presence.js"):
    """Reports to the viewer when the page becomes visible or hidden, and the operator's name that the browser keeps."""

    def __init__(self, viewer: Viewer) -> None:
        super().__init__()

        def changed(event: GenericEventArguments) -> None:
            viewer.visible = event.args is not False

        self.on("visible", changed)
        self.on("operator", lambda event: viewer.reported_operator(event.args))


TAKE, RELEASE, OVER = "Take the camera", "Release the camera", "Take over the camera?"
UNTIL_CLOSED_MS = 0  # duration of a message that stays until it is closed


class ControlButtons:
    """Buttons that take and release the camera.

    They are two, so that a click does what the button said when it was clicked, whatever changes meanwhile.
    """

    def __init__(self, instrument: Instrument, viewer: Viewer) -> None:
        self._instrument, self._viewer = instrument, viewer
        self._released = self._in_control = False
        self._take = widgets.button(TAKE, self._take_control, look="flat dense")
        self._release = widgets.button(RELEASE, self._release_control, look="flat dense")
        self._release.set_visibility(False)

    def show(self, now: InstrumentState) -> None:
        """Show the applicable button; notify when somebody else has taken the camera."""
        mine = now.owner is not None and now.owner.identity == self._viewer.identity
        self._take.set_visibility(not mine)
        self._release.set_visibility(mine)
        if self._in_control and now.owner is not None and not mine:
            ui.notify(
                f"{now.owner.name} took over the camera; you are watching now.",
                type="warning",
                timeout=UNTIL_CLOSED_MS,
                close_button="Close",
            )
        self._in_control = mine

    def report_open(self) -> None:
        """Report that this page is open; it takes a free camera, unless it was released here."""
        control, viewer = self._instrument.control, self._viewer
        if not ui.context.client.has_socket_connection:
            return
        if viewer.visible and not self._released and control.owner() is None:
            with suppress(ControlError):  # somebody has taken it meanwhile
                control.take(viewer.identity, viewer.name)
        control.heard_of(viewer.identity)

    async def _take_control(self) -> None:
        owner = self._instrument.control.owner()
        other = owner is not None and owner.identity != self._viewer.identity
        if owner is None or not other or await widgets.is_confirmed(OVER, yes="Take over", why=_question(owner)):
            await self._take_as(over=other)

    def _release_control(self) -> None:
        self._instrument.control.release(self._viewer.identity)
        self._released, self._in_control = True, False

    async def _take_as(self, *, over: bool) -> None:
        """Take the camera; from another owner only after confirmation."""
        self._released = False
        await self._viewer.attempt(self._instrument.control.take, self._viewer.identity, self._viewer.name, over=over)


def _question(owner: Owner) -> str:
    return f"{owner.name} is using the camera. They will see that you took it, and can then only watch."


KEYS_OF_ALL = (("?", "this help"), ("Tab, Enter", "use every control without a mouse"))


class Help:
    """The help of the open page: what it is for, its keys, fields and terms. A button opens it, and the key ``?``."""

    def __init__(self) -> None:
        self._client = ui.context.client
        self._open: ui.dialog | None = None
        button = ui.button(icon="help_outline", on_click=self.open).props("flat dense round")
        button.props["aria-label"] = "Help"
        ui.keyboard(self._pressed, repeating=False, ignore=["input", "select", "textarea"])

    def _pressed(self, event: KeyEventArguments) -> None:
        if event.action.keydown and event.key == "?":
            self.open()

    def open(self) -> None:
        """Open the help of the page that is open; once."""
        if self._open is not None and self._open.value:
            return
        address = widgets.address_of(self._client.sub_pages_router.current_path)
        page, meanings = widgets.help_texts().get(address, {"text": (), "terms": ()}), widgets.help_texts()["terms"]
        fields = widgets.explained_fields(self._client)
        title = f"Help: {title_of(address)}"
        with widgets.open_dialog(self._client.layout, title, style="dialog-card help") as self._open:
            for text in page["text"]:
                ui.label(text)
            keys = [(item.cap, item.does) for item in SHORTCUTS] if address in ("/", "/hardness") else []
            for heading, facts in (
                ("Keys", [(key, does) for key, does in (*keys, *KEYS_OF_ALL)]),
                ("Fields", fields),
                ("Terms", [(term, meanings[term]) for term in page["terms"]]),
            ):
                if facts:
                    widgets.panel_title(heading, level=3)
                    widgets.FactList().show(facts)
            widgets.button("Close", self._open.close)


OPEN_EVERY_S = 2.0  # between two reports that a page is still open
SHOWN_S = 5.0  # by which the first page is shown
MAIN = "page"  # identity of the element that holds the page, for the link that skips to it


class Shell:
    """Builds the page of every tab of a console."""

    def __init__(self, instrument: Instrument) -> None:
        self._instrument, self._poller, self._tabs = instrument, StatePoller(instrument), Tabs()
        self._shown = threading.Event()  # the first page

    @contextmanager
    def loaded_ahead(self) -> Iterator[None]:
        """Load in the background what the first page needs; when it is shown, what frames need; then other pages."""
        ended = threading.Event()

        def load() -> None:
            packed_colours(FIRST_MAP)
            with suppress(TsisError):  # the page says it
                self._instrument.store.entries()
            self._shown.wait(SHOWN_S)
            if not ended.is_set():
                load_exposure()
            if not ended.wait(SHOWN_S):
                load_pages()
                address(Picture(title="", draw=_blank, size=(1.0, 1.0), alt=""))  # loads what draws

        threading.Thread(target=load, name="loading", daemon=True).start()
        try:
            yield
        finally:
            ended.set()
            self._shown.set()

    def build(self) -> None:
        """Build the page of the tab that opens now."""
        viewer = Viewer(ui.context.client, self._instrument, self._poller, self._tabs)
        ui.context.client.on_connect(self._shown.set)
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
            Help()
            ThemeChoice()
        notices = Notices(self._instrument, viewer)
        with ui.element("div").classes("content").props(f'id="{MAIN}" tabindex="-1"'):
            navigation.pages()
            Subpages({address: partial(build, self._instrument, viewer) for address, (_, build) in PAGES.items()})
        with ui.footer(elevated=False).classes("foot"):
            ui.label(RESEARCH_USE_ONLY)
            if viewer.logged_in:
                with ui.element("form").props(f'method="post" action="{LOGOUT}"').classes("logout"):
                    ui.label(f"Logged in as {viewer.name}.")
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


def _blank(figure: Figure) -> None:
    figure.subplots()


def _camera_text(state: InstrumentState) -> str:
    camera = state.camera
    if state.busy:
        return f"{state.busy} …"
    if not camera.running:
        return "camera stopped"
    if camera.lost:
        return "camera away"
    return f"{camera.frames_per_s:.0f} frames/s, {camera.missed} dropped"
