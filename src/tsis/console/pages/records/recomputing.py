"""Estimates of a target made again with the code of today."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.headings import panel_title
from tsis.console.pages.records.work import follow_job
from tsis.console.pages.report_parts import table
from tsis.records.recompute import recompute
from tsis.report.recomputation import recomputation_notes, shift_table, stored_sentence

if TYPE_CHECKING:
    from tsis.console.bench.jobs import Job
    from tsis.console.pages.records.context import TargetContext
    from tsis.console.pages.records.reading import TargetSeen
    from tsis.records.recompute import Recomputation

EXPLAINED = (
    "The estimates in force are made again from the stored frames. What comes out otherwise is stored as a new "
    "estimate that says which one it takes the place of; the old one stays."
)


def recompute_button(page: TargetContext, seen: TargetSeen) -> None:
    """A button that asks whether to store what comes out, and computes."""
    button = ui.button("Recompute", icon="restart_alt", on_click=lambda: _ask_to_recompute(page, seen))
    button.props("dense no-caps outline").set_enabled(bool(seen.dossier.estimates))


def _ask_to_recompute(page: TargetContext, seen: TargetSeen) -> None:
    with page.dialogs, ui.dialog(value=True) as dialog, ui.card().classes("asked"):
        panel_title(f"Recompute target {seen.target.number}")
        ui.label(EXPLAINED)
        dry = ui.switch("dry run: say what would change, store nothing", value=False)

        async def begin() -> None:
            dialog.close()
            await _begin_recomputation(page, seen, dry_run=dry.value)

        with ui.element("div").classes("row"):
            ui.button("Recompute", on_click=begin).props("no-caps dense unelevated")
            ui.button("Cancel", on_click=dialog.close).props("no-caps dense flat")
    dialog.on("hide", dialog.delete)


async def _begin_recomputation(page: TargetContext, seen: TargetSeen, *, dry_run: bool) -> None:
    store, target = page.bench.store, seen.target
    job: Job | None = await page.viewer.attempt(
        page.bench.jobs.begin,
        f"recomputation of target {target.number}",
        lambda job: recompute(store, target, dry_run=dry_run, progress=job.advance),
    )
    if job is not None:
        follow_job(job, page.below, lambda: _show_recomputation(page, job))


def _show_recomputation(page: TargetContext, job: Job) -> None:
    found: tuple[Recomputation, ...] = job.result
    with ui.element("div").classes("told").props('role="status"'):
        for each in found:
            ui.label(f"{each.before.kind.capitalize()}: {each.sentence}").classes("good" if each.same else "doubtful")
            for note in recomputation_notes(each):
                ui.label(note).classes("muted")
            if not each.same:
                table(shift_table(each))
                ui.label(stored_sentence(each))
        ui.button("Close", on_click=page.below.clear).props("dense no-caps flat")
