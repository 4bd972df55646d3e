"""A console with one page that holds the elements of the live view and nothing else; run as a program of its own."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console import ConsoleSettings, serve_console
from tsis.console import pages as directory
from tsis.console.live.hub import MAPS
from tsis.console.live.view import Histogram, LiveView, SurfaceView
from tsis.console.services.choice import InstrumentSettings

if TYPE_CHECKING:
    from tsis.console.live.view import ColouredFrames
    from tsis.console.services.instrument import Instrument
    from tsis.console.services.state import InstrumentState
    from tsis.console.viewer import Viewer

ENDS: dict[str, str | tuple[float, float]] = {
    "whole": (0.0, 255.0),
    "narrow": (20.0, 75.0),
    "odd": (3.5, 200.25),
    "auto": "auto",
}
LIVE = "getElement(document.querySelector('figure.live'))"  # in scripts of the page
SURFACE = "getElement(document.querySelector('figure.surface'))"


def page(instrument: Instrument, viewer: Viewer) -> None:
    """Build the page."""
    with ui.element("div").classes("split"):
        with ui.element("section").classes("panel"):
            view, surface, histogram = LiveView(), SurfaceView(), Histogram()
            with ui.element("div").classes("row"):
                ui.button("Start", on_click=lambda: viewer.attempt(instrument.start, by=viewer.identity))
                ui.button("Stop", on_click=lambda: viewer.attempt(instrument.stop, by=viewer.identity))
                ui.button("mark limits", on_click=lambda: view.mark_limits(True))
                ui.button("mark nothing", on_click=lambda: view.mark_limits(False))
                for name in MAPS:
                    ui.button(f"map {name}", on_click=partial(_coloured, (view, surface), name))
                for name in ENDS:
                    ui.button(f"ends {name}", on_click=partial(_ended, (view, surface), ENDS[name]))
        with ui.element("section").classes("panel stack") as beside:
            for element in (histogram, surface):
                element.move(beside)

    def show(state: InstrumentState) -> None:
        for element in (view, histogram, surface):
            element.update_state(state)

    viewer.follow(show)


def _coloured(elements: tuple[ColouredFrames, ...], name: str) -> None:
    for element in elements:
        element.colour(name)


def _ended(elements: tuple[ColouredFrames, ...], ends: str | tuple[float, float]) -> None:
    for element in elements:
        element.ends(ends)


def main() -> None:
    """Serve it with what is kept in the folder that was given; print the address."""
    folder = Path(sys.argv[1])
    directory.PAGES.clear()
    directory.PAGES["/"] = ("Elements", page)
    terms = InstrumentSettings(workspace=folder / "workspace", store=folder / "records", probe="tsis-2011")
    serve_console(ConsoleSettings(instrument=terms, port=0), ready=lambda address: print(address, flush=True))  # noqa: T201


if __name__ == "__main__":
    main()
