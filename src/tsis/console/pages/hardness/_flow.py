"""State of a hardness measurement, its next step, and its result."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.calibration import apply_calibration
from tsis.catalog.probes import load_probe
from tsis.console.pages import components as kit
from tsis.console.services import newest_presses
from tsis.hardness import build_contact_table
from tsis.present.hardness import hardness_page
from tsis.records.importing import target_by_number

if TYPE_CHECKING:
    from tsis.console.services import InstrumentState
    from tsis.present.page import Page
    from tsis.records.store import Store
    from tsis.records.values import StoredEstimate, StoredPress, TargetRecord


HARDNESS, TARGET, BALL = "hardness", "target", "ball"
PRESSES = 2  # at different forces, of which the second tests the first


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SavedPresses:
    """The stored presses of the object."""

    number: int  # of the target
    record: TargetRecord | None = None  # None while nothing is stored
    presses: tuple[StoredPress, ...] = ()  # those of the next estimate: the newest of each force
    estimate: StoredEstimate | None = None  # the current hardness

    @property
    def on_object(self) -> tuple[StoredPress, ...]:
        """Presses on the object."""
        return tuple(press for press in self.presses if press.role == TARGET)

    @property
    def is_current(self) -> bool:
        """Whether the estimate rests on these very presses."""
        return self.estimate is not None and set(self.estimate.presses) == {press.id for press in self.presses}


def saved_presses(store: Store, number: int) -> SavedPresses:
    """Read what is stored of a target; errors as of the store."""
    if (target := target_by_number(store, number)) is None:
        return SavedPresses(number=number)
    record = store.record(target)
    estimate = next((stored for stored in record.active_estimates if stored.kind == HARDNESS), None)
    return SavedPresses(number=number, record=record, presses=newest_presses(record, HARDNESS), estimate=estimate)


def next_free(store: Store, number: int) -> int:
    """``number`` while nothing is stored of it, else the next after all targets."""
    free = target_by_number(store, number) is None
    return number if free else max(target.target.number for target in store.targets()) + 1


def missing_text(state: InstrumentState, *, scaled: bool, responds: bool) -> tuple[str, ...]:
    """Messages of what an estimate still needs; empty when it can run.

    ``scaled`` and ``responds`` say whether the active calibration has the size of a pixel and the response to pressure.
    """
    camera = state.camera
    if camera.choice.is_virtual:
        return () if camera.choice.is_sphere and camera.running else ("place an object under the virtual probe.",)
    stopped = "start the camera, on the page Examine; it is stopped."
    results = [] if camera.running else [f"wait; the console is {state.busy}." if state.busy else stopped]
    if camera.running and camera.lost:
        results.append("wait until the camera is back; it is away.")
    if not state.calibration_identity:
        results.append("activate a calibration, on the page Camera; there is none (the page Calibrate makes one).")
    elif not (responds and scaled):
        lacking = "size of a pixel" if responds else "response to pressure"
        results.append(f"choose another calibration; {state.calibration!r} lacks the {lacking}.")
    return tuple(results)


def next_step_text(saved: SavedPresses, missing: tuple[str, ...], *, estimating: bool) -> str:
    """The next step, or the state, as a message."""
    if estimating:
        return "The estimate is running."
    if saved.is_current:
        return "Done. Press again at another force to test it, or begin with another object."
    if (count := len(saved.on_object)) >= PRESSES:
        return "Next: estimate, now that there are presses at two forces."
    if missing:
        return f"Next: {missing[0]}"
    again = "Next: press it again at another force; the second press tests the first."
    return again if count else "Next: press the object, and save the press."


class HardnessPanel:
    """Shows the current hardness."""

    def __init__(self, viewer: kit.Viewer) -> None:
        self._viewer = viewer
        panel = ui.element("section").classes("panel stack hardness-result").props('aria-label="Result"')
        self._panel = kit.Redrawn(panel.set_visibility(False))

    async def show(self, saved: SavedPresses) -> None:
        """Show the estimate where there is one."""
        stored, record = saved.estimate, saved.record
        now = None if stored is None else (stored.id, saved.is_current)
        if not self._panel.changes_to(now):
            return
        self._panel.element.set_visibility(False)
        built = None
        if stored is not None and record is not None:
            built = await self._viewer.attempt(_page_and_figures, record, stored)
        if built is None or self._panel.content != now:
            return
        page, sources = built
        with self._panel.element:
            with kit.title_row(page.title):
                ui.link(f"Report and export of target {saved.number}", f"/records/{saved.number}")
            if not saved.is_current:
                ui.label("New presses were saved: estimate again to include them.").classes("doubtful")
            with ui.element("div").classes("hardness-report"):
                with ui.element("div").classes("stack"):
                    kit.cards(page.cards)
                    for item in page.tables:
                        kit.table(item)
                    kit.message_list(page.notes)
                with ui.element("div").classes("hardness-figures"):
                    for parts in zip(page.pictures, sources, strict=True):
                        kit.figure(*parts)
        self._panel.element.set_visibility(True)


def _page_and_figures(record: TargetRecord, stored: StoredEstimate) -> tuple[Page, tuple[str, ...]]:
    """The estimate's page with its figures drawn."""
    presses = [press for press in record.presses if press.id in stored.presses and press.role == TARGET]
    images = [record.image(press) for press in presses]
    ready, _ = apply_calibration(record.calibrations[stored.calibration], images, identity=stored.calibration)
    page = hardness_page(
        stored.estimate,
        title=f"Hardness of target {record.target.number}" + (f", {record.target.name}" if record.target.name else ""),
        images=ready,
        table=build_contact_table(load_probe(stored.probe)),
        provenance=stored.estimate.provenance,
        truth_kpa=record.target.truth.get("young_kpa"),
    )
    return page, kit.drawings(page)
