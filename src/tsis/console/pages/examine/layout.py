"""How the parts of Examine lie on the page, and who tells them of changes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.examine.estimate_panel import EstimatePanel
from tsis.console.pages.examine.keys import Keys
from tsis.console.pages.examine.live_panel import LivePanel
from tsis.console.pages.examine.press_panel import PressPanel
from tsis.console.pages.examine.reading import Flags, ForceLine
from tsis.console.pages.examine.sequence_panel import SequencePanel
from tsis.console.pages.examine.settings_panel import SettingsPanel
from tsis.console.pages.operated import Operated

if TYPE_CHECKING:
    from tsis.console.bench import Bench, BenchState
    from tsis.console.pages.viewer import Viewer


def page(bench: Bench, viewer: Viewer) -> None:
    """Build the page."""
    operated = Operated(viewer)
    with ui.element("div").classes("split examine"):
        with ui.element("section").classes("stack").props('aria-label="Live image"'):
            live = LivePanel()
        with ui.element("section").classes("stack").props('aria-label="Press, estimate and camera"'):
            with ui.element("div").classes("panel stack tight"):
                press = PressPanel(bench, viewer, operated)
                with press.force_row:
                    force = ForceLine()
                flags = Flags()
                operated.why()
            with ui.element("div").classes("panel under-tabs"):
                with ui.tabs().props("dense no-caps align=left") as tabs:
                    told, set_up, recorded = ui.tab("Estimate"), ui.tab("Settings"), ui.tab("Sequence")
                with ui.tab_panels(tabs, value=told).props("keep-alive").classes("plain-panels"):
                    with ui.tab_panel(told):
                        estimate = EstimatePanel(bench, viewer)
                    with ui.tab_panel(set_up):
                        settings = SettingsPanel(bench, viewer, operated)
                    with ui.tab_panel(recorded):
                        sequence = SequencePanel(bench, viewer, operated)
    Keys(snapshot=press.snapshot, step=press.step, alone=live.alone)

    def show(state: BenchState) -> None:
        for part in (live, press, force, flags, estimate, settings, sequence, operated):
            part.show(state)

    viewer.follow(show)
