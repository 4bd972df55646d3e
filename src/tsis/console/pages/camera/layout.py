"""How the parts of Select camera lie on the page."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.camera.calibration_panel import CalibrationPanel
from tsis.console.pages.camera.chosen_panel import ChosenPanel
from tsis.console.pages.camera.found_panel import FoundPanel
from tsis.console.pages.camera.gauge_panel import GaugePanel
from tsis.console.pages.camera.virtual_panel import VirtualPanel
from tsis.console.pages.operated import Operated

if TYPE_CHECKING:
    from tsis.console.bench import Bench, BenchState
    from tsis.console.pages.viewer import Viewer


def page(bench: Bench, viewer: Viewer) -> None:
    """Build the page."""
    operated = Operated(viewer)
    with ui.element("div").classes("panel stack"):
        chosen = ChosenPanel(bench, viewer, operated)
        operated.why()
    with ui.element("div").classes("camera-columns"):
        with ui.element("div").classes("stack"):
            virtual = VirtualPanel(bench, viewer, operated)
            calibration = CalibrationPanel(bench, viewer, operated)
        with ui.element("div").classes("stack"):
            found = FoundPanel(bench, viewer, operated)
            gauge = GaugePanel(bench, viewer, operated)

    def show(state: BenchState) -> None:
        for part in (chosen, virtual, found, calibration, gauge, operated):
            part.show(state)

    viewer.follow(show)
