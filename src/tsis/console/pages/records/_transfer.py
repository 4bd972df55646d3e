"""Export and import of targets, and verification of the store."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.components import LARGEST_MIB, list_message, message_list, one_file, panel_title
from tsis.console.pages.records._context import fetch_file, follow_job
from tsis.errors import FileInputError
from tsis.records.export.bundle import read_bundle
from tsis.records.store import StoreVerification, verify_store
from tsis.report import FORM_LABELS, MASKED, import_message, verdict, verification_notes

if TYPE_CHECKING:
    from nicegui.events import UploadEventArguments

    from tsis.console.pages.components import Viewer
    from tsis.console.pages.records._context import TargetContext, TargetView
    from tsis.console.services import Instrument, Job
    from tsis.records.store import ImportedTarget


IDENTIFIED = "include label, names and true times"
MEANT = {
    True: "Masked: label, names and times are left out or shifted, unless you ask for them below.",
    False: "This form masks nothing: notes, names and settings are in it.",
}
PAGE = "This form shows what the report shows; of a subject the pseudonym only."


def export_button(page: TargetContext, seen: TargetView) -> None:
    """A button that asks for the form, and downloads the file."""
    ui.button("Export", icon="download", on_click=lambda: _ask(page, seen)).props("dense no-caps outline")


def _ask(page: TargetContext, seen: TargetView) -> None:
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
                page.viewer.notify(f"Exported as {form.value}: the browser saves the file.")
                dialog.close()
            waiting.set_visibility(False)
            begun.enable()

        with ui.element("div").classes("row"):
            begun = ui.button("Export", on_click=begin).props("no-caps dense unelevated")
            ui.button("Cancel", on_click=dialog.close).props("no-caps dense flat")
        told()
    dialog.on("hide", dialog.delete)


BUNDLE = "bundle.zip"
EXPLAINED = (
    "A bundle is the zip file that the export of a target writes. Target, presses and estimates keep their identity: "
    "what is here already stays as it is, and what is taken in twice is here once."
)
TOO_LARGE = f"a bundle must be one zip file of at most {LARGEST_MIB} MiB here; larger ones: tsis records import"


def import_button(instrument: Instrument, viewer: Viewer, place: ui.element) -> None:
    """A button that asks for a bundle, imports it, and shows the result in ``place``."""
    with ui.dialog() as dialog, ui.card().classes("asked"):
        panel_title("Import a bundle")
        ui.label(EXPLAINED).classes("muted")
        upload = one_file(viewer, "Zip file of a bundle", accept=".zip", refused=TOO_LARGE)
        ui.button("Close", on_click=dialog.close).props("dense no-caps flat")

    async def taken(event: UploadEventArguments) -> None:
        upload.reset()
        dialog.close()
        folder = await _saved(event, viewer)
        if folder is None:
            return
        job: Job | None = await viewer.attempt(
            instrument.jobs.begin,
            "import of a bundle",
            lambda job: _take_in(instrument, folder, job),
            after=lambda: _remove(folder),  # also of one that was ended before it began
        )
        if job is None:
            _remove(folder)
        else:
            follow_job(job, place, lambda: _show(job))

    upload.on_upload(taken)
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
            _remove(folder)
        return None
    return folder


def _take_in(instrument: Instrument, folder: Path, job: Job) -> ImportedTarget:
    """Read what was uploaded and enter it."""
    try:
        return instrument.store.import_target(read_bundle(folder / BUNDLE), progress=job.advance)
    except FileInputError as error:  # which names a place that nobody has seen and that is gone in a moment
        raise FileInputError(str(error).replace(f"{folder}/", "")) from error


def _remove(folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)


def _show(job: Job) -> None:
    taken: ImportedTarget = job.result
    with ui.element("div").classes("row").props('role="status"'):
        ui.label(import_message(taken)).classes("good")
        ui.link(f"Open target {taken.target.number}", f"/records/{taken.target.number}").classes("link")


MOST_SHOWN = 100  # faults; a store that has more has one cause


def verify_button(instrument: Instrument, viewer: Viewer, place: ui.element) -> None:
    """A button that verifies the store against its audit, and shows the result in ``place``."""

    async def begin() -> None:
        job: Job | None = await viewer.attempt(
            instrument.jobs.begin, "verify the store", lambda job: verify_store(instrument.store, progress=job.advance)
        )
        if job is not None:
            follow_job(job, place, lambda: _show_verification(job, place))

    ui.button("Verify the store", icon="verified_user", on_click=begin).props("dense no-caps outline")


def _show_verification(job: Job, place: ui.element) -> None:
    store_verification: StoreVerification = job.result
    with ui.element("section").classes("told").props('role="status"'):
        ui.label(verdict(store_verification)).classes("good" if store_verification.sound else "flag")
        with message_list():
            for fault in store_verification.faults[:MOST_SHOWN]:
                list_message(fault, "doubtful")
        if len(store_verification.faults) > MOST_SHOWN:
            ui.label(f"and {len(store_verification.faults) - MOST_SHOWN} faults more (tsis records verify shows all)")
        for note in verification_notes(store_verification):
            ui.label(note).classes("muted identity")
        ui.button("Close", on_click=place.clear).props("dense no-caps flat")
