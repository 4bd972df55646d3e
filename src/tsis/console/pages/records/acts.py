"""What can be done with a target: report, estimate, compute again, export."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.headings import panel_title
from tsis.console.pages.records.estimating import estimate_button
from tsis.console.pages.records.exporting import export_button
from tsis.console.pages.records.recomputing import recompute_button

if TYPE_CHECKING:
    from tsis.console.pages.records.context import TargetContext
    from tsis.console.pages.records.reading import TargetSeen


def acts(page: TargetContext, seen: TargetSeen) -> None:
    """Show the name of the target, the way back, and the buttons."""
    target = seen.target
    name = f": {target.name}" if target.name else ""
    ui.link("All targets", "/records").classes("link")
    panel_title(f"{'Subject, target' if seen.private else 'Target'} {target.number}{name}").classes("target-title")
    ui.element("div").classes("spring")
    estimate_button(page, seen)
    recompute_button(page, seen)
    export_button(page, seen)
    ui.link("Report", f"/files/report/{target.number}.html", new_tab=True).classes("link button")
    ui.link("PDF", f"/files/report/{target.number}.pdf").classes("link button").props("download")
