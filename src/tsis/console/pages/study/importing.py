"""Readings of another device, uploaded as a table."""

from __future__ import annotations

from pathlib import PurePosixPath
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.headings import panel_title
from tsis.console.pages.number_field import typed_number, unit_field
from tsis.console.pages.study.who import name_in, who_field
from tsis.console.pages.upload import LARGEST_MIB, one_file
from tsis.instrument.file_bytes import one_line
from tsis.study.table import READING_COLUMNS, import_table

if TYPE_CHECKING:
    from nicegui.events import UploadEventArguments

    from tsis.console.pages.study.context import StudyContext

EXPLAINED = (
    f"A CSV file with the columns {', '.join(READING_COLUMNS)}. A higher score says that an inclusion is likelier, an empty "
    "one is undecided; the last three may be empty. A table is entered whole or not at all."
)
TOO_LARGE = f"readings must be one CSV file of at most {LARGEST_MIB} MiB here; larger ones: tsis study import"
CUT = "the file did not come whole; try again"


def import_button(page: StudyContext) -> ui.button:
    """A button that asks for device, threshold and file, and enters what the file says."""
    viewer = page.viewer
    with ui.dialog() as dialog, ui.card().classes("asked study-asked"):
        panel_title("Import readings")
        ui.label(EXPLAINED).classes("muted")
        device = unit_field("Device", keys="text")
        threshold = unit_field("Threshold")
        threshold.props("stack-label").props["placeholder"] = "the study's, or that of the first import"
        who = who_field(viewer, "Entered by")
        upload = one_file(viewer, "CSV file of readings", accept=".csv,text/csv", refused=TOO_LARGE)
        ui.button("Close", on_click=dialog.close).props("dense no-caps flat")

    async def taken(event: UploadEventArguments) -> None:
        upload.reset()
        try:
            content = await event.file.read()
        except OSError:
            viewer.complain(CUT)
            return
        named = one_line(PurePosixPath(event.file.name.replace("\\", "/")).name or "readings.csv")
        entered = await viewer.attempt(
            _enter, page, content, named, (device.value or "").strip(), threshold.value or "", name_in(viewer, who)
        )
        if entered is not None:
            viewer.tell(f"{entered} readings entered.")
            dialog.close()

    upload.on_upload(taken)
    return ui.button("Import readings", icon="upload_file", on_click=dialog.open).props("dense no-caps outline")


def _enter(page: StudyContext, content: bytes, file: str, device: str, threshold: str, actor: str) -> int:
    study = page.shelf.study(page.name)
    limit = typed_number("threshold", threshold) if threshold.strip() else None
    after = import_table(study, content, file, device=device, threshold=limit, actor=actor)
    return len(after.readings) - len(study.readings)


__all__ = ["import_button"]
