"""Saved presses of this target, and its estimate: diameter, depth and modulus with uncertainty, or hardness."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from nicegui import run, ui

from tsis.console.pages.components import (
    ProgressBar,
    Redrawn,
    cards,
    estimate_job,
    figure,
    force_text,
    message_list,
    panel_title,
    row,
    rows_under,
    set_class,
)
from tsis.console.services import FAILED
from tsis.errors import TsisError
from tsis.records import ESTIMATES, ROLE_NAMES
from tsis.records.importing import target_by_number
from tsis.report import address, estimate_cards, estimate_messages_of, estimate_pictures
from tsis.report.target import count_of, time_text

if TYPE_CHECKING:
    from tsis.console.pages.components import Viewer
    from tsis.console.services import Instrument, InstrumentState, JobState
    from tsis.model import Estimate
    from tsis.records import StoredEstimate, StoredPress, Target
    from tsis.records.store import Store
    from tsis.report import Picture


SHOWN = 8  # presses, the newest


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SavedTarget:
    """A target's number and its stored record."""

    number: int
    target: Target | None = None  # None while nothing is stored
    count: int = 0  # of all presses
    presses: tuple[StoredPress, ...] = ()  # the newest ones, the newest first
    estimates: tuple[StoredEstimate, ...] = ()  # the current ones
    damaged: tuple[str, ...] = ()  # a message for each record that cannot be shown


def saved_target(store: Store, number: int) -> SavedTarget:
    """Read the target; errors as of the store."""
    if (target := target_by_number(store, number)) is None:
        return SavedTarget(number=number)
    count = store.press_count(target)
    record = store.record(target, limit=SHOWN, offset=max(0, count - SHOWN))
    return SavedTarget(
        number=number,
        target=target,
        count=count,
        presses=record.presses[::-1],
        estimates=record.active_estimates,
        damaged=record.damaged,
    )


def drawn(estimate: Estimate) -> tuple[tuple[Picture, str], ...]:
    """Posterior and section of an estimate with their data addresses; a withheld one says why instead of a number."""
    return tuple((picture, address(picture)) for picture in estimate_pictures(estimate))


EVERY_S = 1.0  # between two readings of the store


class EstimatePanel:
    """Saved presses of the target, the button of an estimate, and its result."""

    def __init__(self, instrument: Instrument, viewer: Viewer) -> None:
        self._instrument, self._viewer = instrument, viewer
        self._state: InstrumentState | None = None
        self._drawn: dict[str, tuple[tuple[Picture, str], ...]] = {}  # by the estimate's identity
        with ui.element("div").classes("row"):
            self._title = panel_title("Target")
            ui.element("div").classes("spring")
            self._report = ui.link("Report", "/records")
            self._hardness = ui.link("Hardness of this object", "/hardness")
            self._begin = ui.button("Estimate", icon="analytics", on_click=self._estimate).props("no-caps outline")
        self._bar = ProgressBar("Progress of the estimate")
        self._message = ui.label().classes("muted wordy").props("role=status")
        self._record = Redrawn(ui.element("div").classes("stack"))
        viewer.every(EVERY_S, self._refresh)

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
            if now == self._record.content:
                return
            saved = await run.io_bound(self._read, state.target)
        except TsisError as error:
            if self._record.changes_to(str(error)):
                with self._record.element:
                    ui.label(str(error)).classes("doubtful")
            return
        if saved is not None and self._state and self._state.target == saved.number and self._record.changes_to(now):
            self._show_recorded(saved)

    def _read(self, number: int) -> SavedTarget:
        """Read the target, and draw those of its estimates that are new."""
        saved = saved_target(self._instrument.store, number)
        shown = [item for item in saved.estimates if item.kind == ESTIMATES[0]]
        self._drawn = {item.id: self._drawn.get(item.id) or drawn(item.estimate) for item in shown}
        return saved

    def _show_recorded(self, saved: SavedTarget) -> None:
        name = f": {saved.target.name}" if saved.target is not None and saved.target.name else ""
        self._title.text = f"Target {saved.number}{name}"
        self._report.set_visibility(saved.target is not None)
        self._report.props["href"] = f"/records/{saved.number}"
        with self._record.element:
            for stored in saved.estimates:
                cards(estimate_cards(stored, {} if saved.target is None else saved.target.truth))
                with ui.element("div").classes("estimate-figures"):
                    for item in self._drawn.get(stored.id, ()):
                        figure(*item)
                message_list(estimate_messages_of(stored))
            for message in saved.damaged:
                ui.label(f"Left out: {message}.").classes("doubtful")
            presses(saved)


def presses(saved: SavedTarget) -> None:
    """The newest presses, one line each."""
    if not saved.count:
        ui.label("No presses of this target yet. Press it and save a snapshot (space bar).").classes("muted")
        return
    more = "" if saved.count <= len(saved.presses) else f", the last {len(saved.presses)}"
    with rows_under(("Pressed", "Force", "Saved at (UTC)", "Flags"), caption=f"{count_of(saved.count, 'press')}{more}"):
        for press in saved.presses:
            flags = ", ".join(press.flags)
            row((ROLE_NAMES[press.role], force_text(press.force_n), time_text(press.taken), flags))


def job_text(job: JobState | None) -> str:
    """How far it is, or why it failed."""
    if job is None:
        return ""
    if job.running:
        fraction = f", {job.done} of {job.total} steps" if job.total else ""
        return f"Estimating{fraction}; the mechanics of a probe are solved once and cached."
    return job.sentence if job.status == FAILED else ""
