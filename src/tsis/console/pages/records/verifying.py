"""Is the store as it was stored? Asked from the list of targets."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.records.work import follow_job
from tsis.console.pages.sentence_list import listed, sentence_list
from tsis.records.verification import verify_store
from tsis.report.verification import verdict, verification_notes

if TYPE_CHECKING:
    from tsis.console.bench import Bench
    from tsis.console.bench.jobs import Job
    from tsis.console.pages.viewer import Viewer
from tsis.records.verification import StoreVerification

MOST_SHOWN = 100  # faults; a store that has more has one cause


def verify_button(bench: Bench, viewer: Viewer, place: ui.element) -> None:
    """A button that has all of the store compared with its audit, and shows in ``place`` what was found."""

    async def begin() -> None:
        job: Job | None = await viewer.attempt(
            bench.jobs.begin, "verify the store", lambda job: verify_store(bench.store, progress=job.advance)
        )
        if job is not None:
            follow_job(job, place, lambda: _show_verification(job, place))

    ui.button("Verify the store", icon="verified_user", on_click=begin).props("dense no-caps outline")


def _show_verification(job: Job, place: ui.element) -> None:
    found: StoreVerification = job.result
    with ui.element("section").classes("told").props('role="status"'):
        ui.label(verdict(found)).classes("good" if found.sound else "flag")
        with sentence_list():
            for fault in found.faults[:MOST_SHOWN]:
                listed(fault, "doubtful")
        if len(found.faults) > MOST_SHOWN:
            ui.label(f"and {len(found.faults) - MOST_SHOWN} faults more (tsis records verify shows all)")
        for note in verification_notes(found):
            ui.label(note).classes("muted identity")
        ui.button("Close", on_click=place.clear).props("dense no-caps flat")
