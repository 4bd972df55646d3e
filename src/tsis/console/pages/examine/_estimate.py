"""Saved presses of this target, and its estimate: diameter, depth and modulus with uncertainty, or hardness."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import run, ui

from tsis.console.pages.components import (
    ProgressBar,
    cards,
    estimate_job,
    force_text,
    message_list,
    panel_title,
    row,
    rows_under,
    set_class,
)
from tsis.console.pages.examine._press import SavedTarget, saved_target
from tsis.console.services import FAILED
from tsis.errors import TsisError
from tsis.records import ROLE_NAMES
from tsis.report import estimate_cards, estimate_messages_of
from tsis.report.target import count_of, time_text

if TYPE_CHECKING:
    from collections.abc import Mapping

    from tsis.console.pages.components import Viewer
    from tsis.console.services import Instrument, InstrumentState, JobState
    from tsis.records import StoredEstimate, StoredPress


LOOK_S = 1.0  # between two looks into the store


class EstimatePanel:
    """Saved presses of the target, the button of an estimate, and its result."""

    def __init__(self, instrument: Instrument, viewer: Viewer) -> None:
        self._instrument, self._viewer = instrument, viewer
        self._state: InstrumentState | None = None
        self._shown: tuple[object, ...] | None = None
        with ui.element("div").classes("row"):
            self._title = panel_title("Target")
            ui.element("div").classes("spring")
            self._report = ui.link("Report", "/records")
            self._hardness = ui.link("Hardness of this object", "/hardness")
            self._begin = ui.button("Estimate", icon="analytics", on_click=self._estimate).props("no-caps outline")
        self._bar = ProgressBar("Progress of the estimate")
        self._message = ui.label().classes("muted wordy").props("role=status")
        self._container = ui.element("div").classes("stack")
        viewer.every(LOOK_S, self._refresh)

    def show(self, state: InstrumentState) -> None:
        """Show how far the estimate is."""
        self._state = state
        job = estimate_job(state)
        sphere = state.camera.choice.is_sphere  # its estimate asks for more than presses
        self._hardness.set_visibility(sphere)
        self._begin.set_visibility(not sphere)
        self._begin.set_enabled(job is None or not job.running)
        self._bar.show(job)
        self._message.text = job_text(job)
        set_class(self._message, "doubtful", job is not None and job.status == FAILED)

    async def _estimate(self) -> None:
        await self._viewer.attempt(self._instrument.estimate, self._instrument.state().target)

    async def _refresh(self) -> None:
        """Read the store after a possible change, also by another tab or a script."""
        state = self._state
        if state is None:
            return
        try:
            now = (await self._viewer.entries(), state.target)
            if now == self._shown:
                return
            result = await run.io_bound(saved_target, self._instrument.store, state.target)
        except TsisError as error:
            self._notify(str(error))
            return
        if result is None or self._state is None or self._state.target != result.number:  # it ends, or look again
            return
        self._shown = now
        self._show_recorded(result)

    def _notify(self, sentence: str) -> None:
        if self._shown == (sentence,):
            return
        self._shown = (sentence,)
        self._container.clear()
        with self._container:
            ui.label(sentence).classes("doubtful")

    def _show_recorded(self, found: SavedTarget) -> None:
        name = f": {found.target.name}" if found.target is not None and found.target.name else ""
        self._title.text = f"Target {found.number}{name}"
        self._report.set_visibility(found.target is not None)
        self._report.props["href"] = f"/records/{found.number}"
        self._container.clear()
        with self._container:
            for stored in found.estimates:
                estimate_parts(stored, {} if found.target is None else found.target.truth)
            for message in found.damaged:
                ui.label(f"Left out: {message}.").classes("doubtful")
            presses(found)


def estimate_parts(stored: StoredEstimate, truth: Mapping[str, float]) -> None:
    """Cards and sentences of an estimate."""
    cards(estimate_cards(stored, truth))
    message_list(estimate_messages_of(stored))


def presses(found: SavedTarget) -> None:
    """The newest presses, one line each."""
    if not found.count:
        ui.label("No presses of this target yet. Press it and save a snapshot (space bar).").classes("muted")
        return
    more = "" if found.count <= len(found.presses) else f", the last {len(found.presses)}"
    with rows_under(("Pressed", "Force", "Saved at (UTC)", "Flags"), caption=f"{count_of(found.count, 'press')}{more}"):
        for press in found.presses:
            row(press_cells(press))


def press_cells(press: StoredPress) -> tuple[str, ...]:
    """Cells of a press in the list."""
    return (
        ROLE_NAMES[press.role],
        force_text(press.force_n),
        time_text(press.taken),
        ", ".join(press.flags),
    )


def job_text(job: JobState | None) -> str:
    """How far it is, or why it failed."""
    if job is None:
        return ""
    if job.running:
        fraction = f", {job.done} of {job.total} steps" if job.total else ""
        return f"Estimating{fraction}; the mechanics of a probe are solved once and cached."
    return job.sentence if job.status == FAILED else ""
