"""A bundle of another store taken into this one."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.headings import panel_title
from tsis.console.pages.records.work import follow_job
from tsis.console.pages.upload import LARGEST_MIB, one_file
from tsis.model.errors import FileInputError
from tsis.records.export import read_bundle
from tsis.report.imported import import_message

if TYPE_CHECKING:
    from nicegui.events import UploadEventArguments

    from tsis.console.bench import Bench
    from tsis.console.bench.jobs import Job
    from tsis.console.pages.viewer import Viewer
    from tsis.records.taking_in import ImportedTarget

BUNDLE = "bundle.zip"
EXPLAINED = (
    "A bundle is the zip file that the export of a target writes. Target, presses and estimates keep their identity: "
    "what is here already stays as it is, and what is taken in twice is here once."
)
TOO_LARGE = f"a bundle must be one zip file of at most {LARGEST_MIB} MiB here; larger ones: tsis records import"


def import_button(bench: Bench, viewer: Viewer, place: ui.element) -> None:
    """A button that asks for a bundle, takes it in, and says in ``place`` what became of it."""
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
            bench.jobs.begin,
            "import of a bundle",
            lambda job: _take_in(bench, folder, job),
            after=lambda: _remove(folder),  # also of one that was ended before it began
        )
        if job is None:
            _remove(folder)
        else:
            follow_job(job, place, lambda: _show(job))

    upload.on_upload(taken)
    ui.button("Import a bundle", icon="upload_file", on_click=dialog.open).props("dense no-caps outline")


async def _saved(event: UploadEventArguments, viewer: Viewer) -> Path | None:
    """What was uploaded in a folder of its own; None, after the reason was told, when there is no room for it."""
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


def _take_in(bench: Bench, folder: Path, job: Job) -> ImportedTarget:
    """Read what was uploaded and enter it."""
    try:
        return bench.store.take_in(read_bundle(folder / BUNDLE), progress=job.advance)
    except FileInputError as error:  # which names a place that nobody has seen and that is gone in a moment
        raise FileInputError(str(error).replace(f"{folder}/", "")) from error


def _remove(folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)


def _show(job: Job) -> None:
    taken: ImportedTarget = job.result
    with ui.element("div").classes("row").props('role="status"'):
        ui.label(import_message(taken)).classes("good")
        ui.link(f"Open target {taken.target.number}", f"/records/{taken.target.number}").classes("link")
