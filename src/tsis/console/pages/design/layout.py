"""The page Design."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import background_tasks, ui

from tsis.console.pages.design.asked_form import AskedForm
from tsis.console.pages.design.desk import DrawingDesk
from tsis.console.pages.design.probe_form import ProbeForm
from tsis.console.pages.design.section import Section
from tsis.console.pages.design.telling import Telling

if TYPE_CHECKING:
    from tsis.console.bench import Bench
    from tsis.console.pages.viewer import Viewer

WHAT = (
    "Nothing is pressed here and no camera is needed: the model behind the estimates tells how well diameter, depth "
    "and modulus of inclusions would be known."
)


async def page(bench: Bench, viewer: Viewer) -> None:
    """Build the page, with what this tab had on its desk."""
    await ui.context.client.connected()
    desk = viewer.kept(DrawingDesk)
    with ui.element("div").classes("design"):
        probe_panel = ui.element("section").classes("panel")
        with ui.element("div").classes("stack"):
            with ui.element("section").classes("panel"):
                section = Section(desk, viewer)
            with ui.element("section").classes("panel"):
                AskedForm(desk)
                telling = Telling(bench, viewer, desk)
        with probe_panel:
            ProbeForm(desk, lambda: background_tasks.create(section.draw(), name="section of the probe"))
            ui.label(WHAT).classes("muted below")
    telling.answer_below()
    await section.draw()
