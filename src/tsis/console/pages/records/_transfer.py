"""Export and import of targets, and verification of the store."""

from __future__ import annotations

import shutil
import tempfile
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.components import (
    LARGEST_MIB,
    dialog_buttons,
    list_message,
    message_list,
    one_file,
    open_dialog,
    panel_title,
)
from tsis.console.pages.records._context import fetch_file, follow_job
from tsis.errors import FileInputError
from tsis.records.export.bundle import read_bundle
from tsis.records.store import verify_store
from tsis.report import FORM_LABELS, MASKED, import_message, verdict, verification_notes

if TYPE_CHECKING:
    from nicegui.events import UploadEventArguments

    from tsis.console.pages.components import Viewer
    from tsis.console.pages.records._context import TargetContext, TargetView
    from tsis.console.services import Instrument, Job
    from tsis.records.store import ImportedTarget, StoreVerification


IDENTIFIED = "include label, names and true times"
MEANT = {
    True: "Masked: label, names and times are left out or shifted, unless you ask for them below.",
    False: "This form masks nothing: notes, names and settings are in it.",
}
PAGE = "This form shows what the report shows; of a subject the pseudonym only."


def export_button(page: TargetContext, view: TargetView) -> None:
    """A button that asks for the form, and downloads the file."""
    ui.button("Export", icon="download", on_click=lambda: _ask(page, view)).props("dense no-caps outline")


def _ask(page: TargetContext, view: TargetView) -> None:
    with open_dialog(page.dialogs, f"Export target {view.target.number}") as dialog:
        form = ui.select(FORM_LABELS, value="csv", label="Form", on_change=lambda: explain()).props("outlined dense")
        meant = ui.label().classes("muted")
        identified = ui.switch(IDENTIFIED, value=False).props("dense")
        waiting = ui.linear_progress(show_value=False).props('indeterminate aria-label="writing the file"')
        waiting.set_visibility(False)

        def explain() -> None:
            masked = form.value in MASKED
            meant.text = PAGE if form.value in ("html", "pdf") else MEANT[masked]
            identified.set_visibility(masked)

        async def begin() -> None:
            with_names = bool(identified.value) and form.value in MASKED
            waiting.set_visibility(True)
            button.disable()
            address = f"/files/export/{view.target.number}/{form.value}" + ("?identified=true" if with_names else "")
            if await fetch_file(page.viewer, address):
                page.viewer.notify(f"Exported as {form.value}: the browser saves the file.")
                dialog.close()
            waiting.set_visibility(False)
            button.enable()

        button = dialog_buttons(dialog, "Export", begin)
        explain()


BUNDLE = "bundle.zip"
EXPLAINED = (
    "A bundle is the zip file that the export of a target writes. Target, presses and estimates keep their identity: "
    "what is here already stays as it is, and what is taken in twice is here once."
)
TOO_LARGE = f"a bundle must be one zip file of at most {LARGEST_MIB} MiB here; larger ones: tsis records import"


def import_button(instrument: Instrument, viewer: Viewer, place: ui.element) -> None:
    """A button that asks for a bundle, imports it, and shows the result in ``place``."""
    with ui.dialog() as dialog, ui.card().classes("dialog-card"):
        panel_title("Import a bundle")
        ui.label(EXPLAINED).classes("muted")
        upload = one_file(viewer, "Zip file of a bundle", accept=".zip", refused=TOO_LARGE)
        ui.button("Close", on_click=dialog.close).props("dense no-caps flat")

    async def uploaded(event: UploadEventArguments) -> None:
        upload.reset()
        dialog.close()
        folder = await _saved(event, viewer)
        if folder is None:
            return
        remove = partial(shutil.rmtree, folder, ignore_errors=True)
        work = partial(_import, instrument, folder)
        begin = partial(instrument.jobs.begin, "import of a bundle", work, after=remove)  # also of a cancelled one
        if not await follow_job(viewer, place, begin, _show):
            remove()

    upload.on_upload(uploaded)
    ui.button("Import a bundle", icon="upload_file", on_click=dialog.open).props("dense no-caps outline")


async def _saved(event: UploadEventArguments, viewer: Viewer) -> Path | None:
    """The upload in its own folder; None, after a message, when the disk is full."""
    folder: Path | None = None
    try:
        folder = Path(tempfile.mkdtemp(prefix="tsis-import-"))
        await event.file.save(folder / BUNDLE)
    except OSError as error:
        viewer.complain(f"a bundle that is imported needs room for a copy; got: {error.strerror or error}")
        if folder is not None:
            shutil.rmtree(folder, ignore_errors=True)
        return None
    return folder


def _import(instrument: Instrument, folder: Path, job: Job) -> ImportedTarget:
    try:
        return instrument.store.import_target(read_bundle(folder / BUNDLE), progress=job.advance)
    except FileInputError as error:  # it names the temporary folder
        raise FileInputError(str(error).replace(f"{folder}/", "")) from error


def _show(imported: ImportedTarget) -> None:
    with ui.element("div").classes("row").props('role="status"'):
        ui.label(import_message(imported)).classes("good")
        ui.link(f"Open target {imported.target.number}", f"/records/{imported.target.number}").classes("link")


MOST_SHOWN = 100  # faults; a store that has more has one cause


def verify_button(instrument: Instrument, viewer: Viewer, place: ui.element) -> None:
    """A button that verifies the store against its audit, and shows the result in ``place``."""

    async def begin() -> None:
        def verify() -> Job:
            return instrument.jobs.begin(
                "verify the store", lambda job: verify_store(instrument.store, progress=job.advance)
            )

        await follow_job(viewer, place, verify, partial(_show_verification, place))

    ui.button("Verify the store", icon="verified_user", on_click=begin).props("dense no-caps outline")


def _show_verification(place: ui.element, verification: StoreVerification) -> None:
    with ui.element("section").classes("outcome").props('role="status"'):
        ui.label(verdict(verification)).classes("good" if verification.sound else "flag")
        with message_list():
            for fault in verification.faults[:MOST_SHOWN]:
                list_message(fault, "doubtful")
        if len(verification.faults) > MOST_SHOWN:
            ui.label(f"and {len(verification.faults) - MOST_SHOWN} faults more (tsis records verify shows all)")
        for note in verification_notes(verification):
            ui.label(note).classes("muted identity")
        ui.button("Close", on_click=place.clear).props("dense no-caps flat")
