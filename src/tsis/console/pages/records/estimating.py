"""An estimate from stored presses of a target."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.headings import panel_title
from tsis.console.pages.records.work import follow_job
from tsis.records.values import ESTIMATES
from tsis.report.target_words import count_of

if TYPE_CHECKING:
    from tsis.console.pages.records.context import TargetContext
    from tsis.console.pages.records.reading import TargetSeen

NEWEST = "the newest press of each role and force"


def estimate_button(page: TargetContext, seen: TargetSeen) -> None:
    """A button that asks what to estimate from, and does it."""
    ui.button("Estimate", icon="calculate", on_click=lambda: _ask(page, seen)).props("dense no-caps outline")


def _ask(page: TargetContext, seen: TargetSeen) -> None:
    chosen = tuple(page.presses.chosen)
    ways = {"newest": NEWEST, **({"chosen": f"the {count_of(len(chosen), 'press')} chosen below"} if chosen else {})}
    with page.dialogs, ui.dialog(value=True) as dialog, ui.card().classes("asked"):
        panel_title(f"Estimate target {seen.target.number}")
        last = seen.dossier.estimate
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


async def _begin(page: TargetContext, seen: TargetSeen, kind: str, presses: tuple[str, ...] | None) -> None:
    job = await page.viewer.attempt(page.bench.estimate, seen.target.number, kind=kind, presses=presses)
    if job is not None:
        follow_job(job, page.below, _show)


def _show() -> None:
    ui.label("The estimate is stored and in force.").classes("good").props('role="status"')
