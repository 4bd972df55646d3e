"""Estimates of a target: the current ones, and all before."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.components import (
    cards,
    dialog_buttons,
    list_message,
    message_list,
    open_dialog,
    panel_title,
    table,
)
from tsis.console.pages.records._context import follow_job
from tsis.records import ESTIMATES
from tsis.report import estimate_messages_of, recomputation_message, recomputation_notes, shift_table
from tsis.report.target import IDENTITY_NOTE, count_of, history_tables, newest_first, origin, target_cards

if TYPE_CHECKING:
    from tsis.console.pages.records._context import TargetContext, TargetView
    from tsis.records import Recomputation, StoredEstimate


NONE_YET = "Nothing was estimated yet. Estimate needs presses that were taken under a calibration."


def estimates(view: TargetView) -> None:
    """Show the estimates in force, and what of the target is damaged."""
    panel_title("Current estimates", level=3)
    result = newest_first(view.record)
    if result:
        cards(target_cards(view.record))
    else:
        ui.label(NONE_YET).classes("muted")
    with message_list():
        for stored in result:
            for message in (*estimate_messages_of(stored), origin(stored)):
                list_message(f"Of the {stored.kind}: {message}" if len(result) > 1 else message)
            if stored.estimate.flags:
                list_message(f"Flags: {', '.join(stored.estimate.flags)}", "doubtful")
        for message in view.record.damaged:
            list_message(f"Left out: {message}", "flag")
    if view.private:
        ui.label(IDENTITY_NOTE).classes("muted")


def history(view: TargetView) -> None:
    """Show all estimates."""
    result = history_tables(view.record)
    for item in result:
        table(item)
    if not result:
        panel_title("History", level=3)
        ui.label("No estimate yet.").classes("muted")


NEWEST = "the newest press of each role and force"


def estimate_button(page: TargetContext, view: TargetView) -> None:
    """A button that asks what to estimate from, and does it."""
    ui.button("Estimate", icon="calculate", on_click=lambda: _ask(page, view)).props("dense no-caps outline")


def _ask(page: TargetContext, view: TargetView) -> None:
    chosen, number, last = tuple(page.presses.chosen), view.target.number, view.record.estimate
    ways = {"newest": NEWEST, **({"chosen": f"the {count_of(len(chosen), 'press')} chosen below"} if chosen else {})}
    with open_dialog(page.dialogs, f"Estimate target {number}") as dialog:
        kind = ui.select(list(ESTIMATES), value=ESTIMATES[0] if last is None else last.kind, label="What")
        kind.props("outlined dense")
        way = ui.radio(ways, value="chosen" if chosen else "newest").props("dense")
        ui.label("All presses must be of one probe under one calibration.").classes("muted")

        async def begin() -> None:
            dialog.close()
            presses = chosen if way.value == "chosen" else None
            estimate = partial(page.instrument.estimate, number, kind=kind.value, presses=presses)
            await follow_job(page.viewer, page.below, estimate, _show)

        dialog_buttons(dialog, "Estimate", begin)


def _show(_: StoredEstimate) -> None:
    ui.label("The estimate is stored and current.").classes("good").props('role="status"')


EXPLAINED = (
    "The current estimates are recomputed from the stored frames. A different result is stored as a new "
    "estimate that says which one it replaces; the old one stays."
)


def recompute_button(page: TargetContext, view: TargetView) -> None:
    """A button that asks whether to store what comes out, and computes."""
    button = ui.button("Recompute", icon="restart_alt", on_click=lambda: _ask_to_recompute(page, view))
    button.props("dense no-caps outline").set_enabled(bool(view.record.estimates))


def _ask_to_recompute(page: TargetContext, view: TargetView) -> None:
    target = view.target
    with open_dialog(page.dialogs, f"Recompute target {target.number}") as dialog:
        ui.label(EXPLAINED)
        dry = ui.switch("dry run: show changes, store nothing", value=False)

        async def begin() -> None:
            dialog.close()
            recompute = partial(page.instrument.recompute, target, dry_run=dry.value)
            await follow_job(page.viewer, page.below, recompute, partial(_show_recomputation, page))

        dialog_buttons(dialog, "Recompute", begin)


def _show_recomputation(page: TargetContext, recomputations: tuple[Recomputation, ...]) -> None:
    with ui.element("div").classes("outcome").props('role="status"'):
        for item in recomputations:
            ui.label(f"{item.before.kind.capitalize()}: {item.message}").classes("good" if item.same else "doubtful")
            for note in recomputation_notes(item):
                ui.label(note).classes("muted")
            if not item.same:
                table(shift_table(item))
                ui.label(recomputation_message(item))
        ui.button("Close", on_click=page.below.clear).props("dense no-caps flat")
