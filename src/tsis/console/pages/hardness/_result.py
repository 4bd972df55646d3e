"""The result: modulus with interval, Shore hardness, and limits."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.calibration import apply_calibration
from tsis.catalog import load_probe
from tsis.console.pages.components import Redrawn, cards, drawings, figure, message_list, panel_title, table
from tsis.hardness import build_contact_table
from tsis.report import hardness_page

if TYPE_CHECKING:
    from tsis.console.pages.components import Viewer
    from tsis.console.pages.hardness._flow import SavedPresses
    from tsis.records import StoredEstimate, TargetRecord
    from tsis.report import Page


class HardnessPanel:
    """Shows the current hardness."""

    def __init__(self, viewer: Viewer) -> None:
        self._viewer = viewer
        panel = ui.element("section").classes("panel stack hardness-result").props('aria-label="Result"')
        self._panel = Redrawn(panel.set_visibility(False))

    async def show(self, saved: SavedPresses) -> None:
        """Show the estimate where there is one."""
        stored, record = saved.estimate, saved.record
        now = None if stored is None else (stored.id, saved.is_current)
        if not self._panel.changes_to(now):
            return
        self._panel.element.set_visibility(False)
        if stored is None or record is None:
            return
        result = await self._viewer.attempt(_page_and_figures, record, stored)
        if result is None or self._panel.content != now:
            return
        page, sources = result
        with self._panel.element:
            with ui.element("div").classes("row"):
                panel_title(page.title)
                ui.element("div").classes("spring")
                ui.link(f"Report and export of target {saved.number}", f"/records/{saved.number}")
            if not saved.is_current:
                ui.label("Presses were saved since: estimate again to include them.").classes("doubtful")
            with ui.element("div").classes("hardness-report"):
                with ui.element("div").classes("stack"):
                    cards(page.cards)
                    for item in page.tables:
                        table(item)
                    message_list(page.notes)
                with ui.element("div").classes("hardness-figures"):
                    for picture, source in zip(page.pictures, sources, strict=True):
                        figure(picture, source)
        self._panel.element.set_visibility(True)


def _page_and_figures(record: TargetRecord, stored: StoredEstimate) -> tuple[Page, tuple[str, ...]]:
    """The estimate's page with its figures drawn."""
    presses = [press for press in record.presses if press.id in stored.presses and press.role == "target"]
    images = [record.image(press) for press in presses]
    ready, _ = apply_calibration(record.calibrations[stored.calibration], images, identity=stored.calibration)
    probe = load_probe(stored.probe)
    page = hardness_page(
        stored.estimate,
        title=f"Hardness of target {record.target.number}" + (f", {record.target.name}" if record.target.name else ""),
        images=ready,
        table=build_contact_table(probe),
        provenance=stored.estimate.provenance,
        truth_kpa=record.target.truth.get("young_kpa"),
    )
    return page, drawings(page)
