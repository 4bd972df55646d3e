"""The page of a browser's tab, around the pages."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.console.pages.directory import PAGES
from tsis.console.pages.glance import Glance
from tsis.console.pages.shell.holding import Holding
from tsis.console.pages.shell.job_list import JobList
from tsis.console.pages.shell.leaving import Leaving
from tsis.console.pages.shell.navigation import Navigation
from tsis.console.pages.shell.notices import Notices
from tsis.console.pages.shell.presence import Presence
from tsis.console.pages.shell.subpages import Subpages
from tsis.console.pages.shell.theme import ThemeChoice
from tsis.console.pages.tabs import Tabs
from tsis.console.pages.viewer import Viewer

if TYPE_CHECKING:
    from tsis.console.bench import Bench, BenchState

HEARD_S = 2.0  # between two signs that a page is still open
MAIN = "page"  # identity of the element that holds the page, for the link that skips to it


class Shell:
    """Builds the page of every tab of a console.

    Parameters
    ----------
    bench
        What the pages show.
    """

    def __init__(self, bench: Bench) -> None:
        self._bench, self._glance, self._tabs = bench, Glance(bench), Tabs()

    def build(self) -> None:
        """Build the page of the tab that opens now."""
        viewer = Viewer(ui.context.client, self._bench, self._glance, self._tabs)
        with ui.header(elevated=False).classes("bar"):
            ui.link("Skip to the page", f"#{MAIN}").classes("skip")
            ui.label("tsis").classes("brand")
            navigation = Navigation()
            ui.element("div").classes("spring")
            camera = ui.label().classes("chip").mark("camera state")
            jobs = JobList(self._bench, viewer)
            holding = Holding(self._bench, viewer)
            ThemeChoice()
        notices = Notices(viewer)
        with ui.element("div").classes("content").props(f'id="{MAIN}" tabindex="-1"'):
            navigation.heading()
            Subpages({address: partial(build, self._bench, viewer) for address, (_, build) in PAGES.items()})
        with ui.footer(elevated=False).classes("foot"):
            ui.label(RESEARCH_USE_ONLY)
            Leaving()
        Presence(viewer)

        def show(now: BenchState) -> None:
            camera.text = _camera_words(now)
            camera.classes(replace="chip bad" if now.camera.lost else "chip")
            jobs.show(now)
            holding.show(now)
            notices.show(now)

        viewer.follow(show)
        ui.timer(HEARD_S, holding.heard)


def _camera_words(state: BenchState) -> str:
    camera = state.camera
    if not camera.running:
        return "camera stopped"
    if camera.lost:
        return "camera away"
    return f"{camera.frames_per_s:.0f} frames/s, {camera.missed} dropped"
