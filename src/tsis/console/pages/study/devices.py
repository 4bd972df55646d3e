"""How far each device is, and its readings as a table."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.study import export_readings

if TYPE_CHECKING:
    from tsis.console.pages.study.context import StudyContext
    from tsis.console.pages.study.seen import StudySeen

NONE_YET = "Nothing was read yet. Run the virtual probe, or import the readings of another device."


def show_devices(page: StudyContext, found: StudySeen) -> None:
    """Place the devices with their operators."""
    if not found.devices:
        ui.label(NONE_YET).classes("muted")
    for device in found.study.devices:
        held = [each for each in found.devices if each.device == device]
        with ui.element("div").classes("study-device"):
            with ui.element("div").classes("row"):
                ui.label(device).classes("strong wordy")
                ui.label(f"threshold {held[0].threshold:g}").classes("muted")
                ui.element("div").classes("spring")
                export = ui.button(
                    "Export readings", icon="download", on_click=lambda _, device=device: _export(page, device)
                )
                export.props("dense no-caps outline").props["aria-label"] = f"Export readings of {device}"
            for each in held:
                undecided = f", {each.undecided} undecided" if each.undecided else ""
                ui.label(f"{each.operator}: {each.read} of {each.wanted} read{undecided}").classes("wordy")
                bar = ui.linear_progress(min(1.0, each.read / each.wanted), show_value=False, size="6px")
                bar.props["aria-label"] = f"Read with {device} by {each.operator}"


async def _export(page: StudyContext, device: str) -> None:
    content = await page.viewer.attempt(lambda: export_readings(page.shelf.study(page.name), device))
    if content is not None:
        words = re.sub(r"[^A-Za-z0-9]+", "-", device).strip("-") or "device"
        ui.download.content(content, f"{page.name}-{words[:60]}.csv", "text/csv")


__all__ = ["show_devices"]
