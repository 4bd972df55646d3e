"""Estimates of a target: the current ones, and all before."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.components import cards, list_message, message_list, panel_title, table
from tsis.console.pages.records._context import follow_job
from tsis.records import ESTIMATES, recompute
from tsis.report import estimate_messages_of, recomputation_message, recomputation_notes, shift_table
from tsis.report.target import IDENTITY_NOTE, count_of, history_tables, newest_first, origin, target_cards

if TYPE_CHECKING:
    from tsis.console.pages.records._context import TargetContext, TargetView
    from tsis.console.services import Job
    from tsis.records import Recomputation


NONE_YET = "Nothing was estimated yet. Estimate needs presses that were taken under a calibration."


def estimates(seen: TargetView) -> None:
    """Show the estimates in force, and what of the target is damaged."""
    panel_title("Current estimates", level=3)
    result = newest_first(seen.record)
    if result:
        cards(target_cards(seen.record))
    else:
        ui.label(NONE_YET).classes("muted")
    with message_list():
        for stored in result:
            for message in (*estimate_messages_of(stored), origin(stored)):
                list_message(f"Of the {stored.kind}: {message}" if len(result) > 1 else message)
            if stored.estimate.flags:
                list_message(f"Flags: {', '.join(stored.estimate.flags)}", "doubtful")
        for message in seen.record.damaged:
            list_message(f"Left out: {message}", "flag")
    if seen.private:
        ui.label(IDENTITY_NOTE).classes("muted")


def history(seen: TargetView) -> None:
    """Show all estimates."""
    result = history_tables(seen.record)
    for item in result:
        table(item)
    if not result:
        panel_title("History", level=3)
        ui.label("No estimate yet.").classes("muted")


NEWEST = "the newest press of each role and force"


def estimate_button(page: TargetContext, seen: TargetView) -> None:
    """A button that asks what to estimate from, and does it."""
    ui.button("Estimate", icon="calculate", on_click=lambda: _ask(page, seen)).props("dense no-caps outline")


def _ask(page: TargetContext, seen: TargetView) -> None:
    chosen = tuple(page.presses.chosen)
    ways = {"newest": NEWEST, **({"chosen": f"the {count_of(len(chosen), 'press')} chosen below"} if chosen else {})}
    with page.dialogs, ui.dialog(value=True) as dialog, ui.card().classes("asked"):
        panel_title(f"Estimate target {seen.target.number}")
        last = seen.record.estimate
        kind = ui.select(list(ESTIMATES), value=ESTIMATES[0] if last is None else last.kind, label="What").props(
            "outlined dense"
        )
        way = ui.radio(ways, value="chosen" if chosen else "newest").props("dense")
        ui.label("All presses must be of one probe under one calibration.").classes("muted")

        async def begin() -> None:
            dialog.close()
            await _begin(page, seen, kind.value, chosen if way.value == "chosen" else None)

        with ui.element("div").classes("row"):
            ui.button("Estimate", on_click=begin).props("no-caps dense unelevated")
            ui.button("Cancel", on_click=dialog.close).props("no-caps dense flat")
    dialog.on("hide", dialog.delete)


async def _begin(page: TargetContext, seen: TargetView, kind: str, presses: tuple[str, ...] | None) -> None:
    job = await page.viewer.attempt(page.instrument.estimate, seen.target.number, kind=kind, presses=presses)
    if job is not None:
        follow_job(job, page.below, _show)


def _show() -> None:
    ui.label("The estimate is stored and current.").classes("good").props('role="status"')


EXPLAINED = (
    "The current estimates are recomputed from the stored frames. A different result is stored as a new "
    "estimate that says which one it takes the place of; the old one stays."
)


def recompute_button(page: TargetContext, seen: TargetView) -> None:
    """A button that asks whether to store what comes out, and computes."""
    button = ui.button("Recompute", icon="restart_alt", on_click=lambda: _ask_to_recompute(page, seen))
    button.props("dense no-caps outline").set_enabled(bool(seen.record.estimates))


def _ask_to_recompute(page: TargetContext, seen: TargetView) -> None:
    with page.dialogs, ui.dialog(value=True) as dialog, ui.card().classes("asked"):
        panel_title(f"Recompute target {seen.target.number}")
        ui.label(EXPLAINED)
        dry = ui.switch("dry run: show changes, store nothing", value=False)

        async def begin() -> None:
            dialog.close()
            await _begin_recomputation(page, seen, dry_run=dry.value)

        with ui.element("div").classes("row"):
            ui.button("Recompute", on_click=begin).props("no-caps dense unelevated")
            ui.button("Cancel", on_click=dialog.close).props("no-caps dense flat")
    dialog.on("hide", dialog.delete)


async def _begin_recomputation(page: TargetContext, seen: TargetView, *, dry_run: bool) -> None:
    store, target = page.instrument.store, seen.target
    job: Job | None = await page.viewer.attempt(
        page.instrument.jobs.begin,
        f"recomputation of target {target.number}",
        lambda job: recompute(store, target, dry_run=dry_run, progress=job.advance),
    )
    if job is not None:
        follow_job(job, page.below, lambda: _show_recomputation(page, job))


def _show_recomputation(page: TargetContext, job: Job) -> None:
    recomputations: tuple[Recomputation, ...] = job.result
    with ui.element("div").classes("told").props('role="status"'):
        for item in recomputations:
            ui.label(f"{item.before.kind.capitalize()}: {item.message}").classes("good" if item.same else "doubtful")
            for note in recomputation_notes(item):
                ui.label(note).classes("muted")
            if not item.same:
                table(shift_table(item))
                ui.label(recomputation_message(item))
        ui.button("Close", on_click=page.below.clear).props("dense no-caps flat")
