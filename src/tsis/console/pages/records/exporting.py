"""A target in the forms that people and other programs read."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.headings import panel_title
from tsis.console.pages.records.fetching import fetch_file
from tsis.report.forms import FORM_LABELS, MASKED

if TYPE_CHECKING:
    from tsis.console.pages.records.context import TargetContext
    from tsis.console.pages.records.reading import TargetSeen

IDENTIFIED = "tell label, names and true times"
MEANT = {
    True: "Masked: label, names and times are left out or shifted, unless you ask for them below.",
    False: "This form masks nothing: notes, names and settings are in it.",
}
PAGE = "This form shows what the report shows; of a subject the pseudonym only."


def export_button(page: TargetContext, seen: TargetSeen) -> None:
    """A button that asks for the form, and has the browser keep the file."""
    ui.button("Export", icon="download", on_click=lambda: _ask(page, seen)).props("dense no-caps outline")


def _ask(page: TargetContext, seen: TargetSeen) -> None:
    with page.dialogs, ui.dialog(value=True) as dialog, ui.card().classes("asked"):
        panel_title(f"Export target {seen.target.number}")
        form = ui.select(FORM_LABELS, value="csv", label="Form", on_change=lambda: told()).props("outlined dense")
        meant = ui.label().classes("muted")
        identified = ui.switch(IDENTIFIED, value=False).props("dense")
        waiting = ui.linear_progress(show_value=False).props('indeterminate aria-label="writing the file"')
        waiting.set_visibility(False)

        def told() -> None:
            masked = form.value in MASKED
            meant.text = PAGE if form.value in ("html", "pdf") else MEANT[masked]
            identified.set_visibility(masked)

        async def begin() -> None:
            with_names = bool(identified.value) and form.value in MASKED
            waiting.set_visibility(True)
            begun.disable()
            address = f"/files/export/{seen.target.number}/{form.value}" + ("?identified=true" if with_names else "")
            if await fetch_file(page.viewer, address):
                page.viewer.tell(f"Exported as {form.value}: the browser keeps the file.")
                dialog.close()
            waiting.set_visibility(False)
            begun.enable()

        with ui.element("div").classes("row"):
            begun = ui.button("Export", on_click=begin).props("no-caps dense unelevated")
            ui.button("Cancel", on_click=dialog.close).props("no-caps dense flat")
        told()
    dialog.on("hide", dialog.delete)
