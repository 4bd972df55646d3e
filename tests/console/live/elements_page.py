"""A console with one page that holds the elements of the live view and nothing else; run as a program of its own."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from nicegui import ui

from tsis.console import pages as directory
from tsis.console.live.hub import MAPS
from tsis.console.live.panel import FramePanel, still_panel
from tsis.console.live.press_curve import PressCurve
from tsis.console.live.view import LiveView, SurfaceView
from tsis.console.services.choice import InstrumentSettings
from tsis.console.serving import ConsoleSettings, serve_console
from tsis.model.image import TactileImage

if TYPE_CHECKING:
    from tsis.console.live.view import ColouredFrames
    from tsis.console.services.instrument import Instrument
    from tsis.console.services.state import InstrumentState
    from tsis.console.viewer import Viewer

ENDS: dict[str, tuple[tuple[float, float], float]] = {
    "whole": ((0.0, 255.0), 1.0),
    "narrow": ((20.0, 75.0), 1.0),
    "odd": ((3.5, 200.25), 0.5),
}
LIVE = "getElement(document.querySelector('figure.live'))"  # in scripts of the page
SURFACE = "getElement(document.querySelector('figure.surface'))"
ROWS, COLUMNS, MM_PER_PIXEL = 120, 200, (0.1, 0.1)


def still_levels() -> np.ndarray:
    """Levels of the single frame: a hill on noise."""
    x, y = np.meshgrid(np.arange(COLUMNS), np.arange(ROWS))
    hill = 20 + 180 * np.exp(-(((x - 90) / 30) ** 2) - ((y - 50) / 20) ** 2)
    noise = np.random.default_rng(5).normal(0, 4, hill.shape)
    levels: np.ndarray = (hill + noise).round().clip(0, 255)
    return levels


def page(instrument: Instrument, viewer: Viewer) -> None:
    """Build the page."""
    with ui.element("div").classes("split"):
        with ui.element("section").classes("panel live-part"):
            panel = FramePanel(lambda map_name: LiveView(map_name=map_name), instrument.newest_image)
            view = panel.view
            with ui.element("div").classes("row"):
                ui.button("Start", on_click=lambda: viewer.attempt(instrument.start, by=viewer.identity))
                ui.button("Stop", on_click=lambda: viewer.attempt(instrument.stop, by=viewer.identity))
                ui.button("mark limits", on_click=lambda: view.mark_limits(True))
                ui.button("mark nothing", on_click=lambda: view.mark_limits(False))
                for name in MAPS:
                    ui.button(f"map {name}", on_click=lambda _, name=name: _coloured((view, surface), name))
                for name in ENDS:
                    ui.button(f"ends {name}", on_click=lambda _, name=name: _ended((view, surface), *ENDS[name]))
        with ui.element("section").classes("panel stack"):
            surface: SurfaceView = SurfaceView()
            curve = PressCurve()
            ui.button("single frame", on_click=partial(_single, ui.element("div").classes("single")))

    def show(state: InstrumentState) -> None:
        for element in (view, surface):
            element.update_state(state)
        panel.range.show(state.frame_analysis, state.camera.full_scale)
        curve.show(instrument.moments(), state.camera.mm_per_pixel)

    viewer.follow(show)
    viewer.every(0.3, panel.tools.refresh)


def _single(place: ui.element) -> None:
    place.clear()
    with place:
        still_panel(TactileImage(grey=still_levels(), mm_per_pixel=MM_PER_PIXEL), "single frame")


def _coloured(elements: tuple[ColouredFrames, ...], name: str) -> None:
    for element in elements:
        element.colour(name)


def _ended(elements: tuple[ColouredFrames, ...], ends: tuple[float, float], gamma: float) -> None:
    for element in elements:
        element.ends(ends, gamma)


def main() -> None:
    """Serve it with what is kept in the folder that was given; print the address."""
    folder = Path(sys.argv[1])
    directory.PAGES.clear()
    directory.PAGES["/"] = ("Elements", page)
    directory.GROUPS.clear()
    directory.GROUPS["Elements"] = ("/",)
    terms = InstrumentSettings(workspace=folder / "workspace", store=folder / "records", probe="tsis-2011")
    serve_console(ConsoleSettings(instrument=terms, port=0), ready=lambda address: print(address, flush=True))  # noqa: T201


if __name__ == "__main__":
    main()
