"""Hardness: two presses on an object itself, and how stiff it is."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from nicegui import run, ui

from tsis.calibration.frames import apply_calibration
from tsis.catalog.phantoms import list_spheres
from tsis.catalog.probes import load_probe
from tsis.console import widgets
from tsis.console.messages import with_field_labels
from tsis.console.pages.examine import (
    MEASURE_EVERY_S,
    FlagList,
    ForceRow,
    LivePanel,
    PressPanel,
    TakeButton,
    act_on_keys,
)
from tsis.console.pages.records import ReportButton, flag_text
from tsis.console.services.choice import BALL_MM, CameraChoice
from tsis.console.services.instrument import newest_presses
from tsis.console.services.jobs import FAILED
from tsis.errors import InputError, TsisError
from tsis.hardness.estimation import RADIUS_SD_MM, require_radius
from tsis.hardness.table import build_contact_table
from tsis.model.require import require_number
from tsis.present.hardness import hardness_page
from tsis.records.importing import target_by_number
from tsis.records.values import ROLE_NAMES

if TYPE_CHECKING:
    from tsis.console.services.instrument import Instrument
    from tsis.console.services.jobs import Job, JobState
    from tsis.console.services.state import InstrumentState
    from tsis.console.viewer import Viewer
    from tsis.present.page import Page
    from tsis.records.store import Store
    from tsis.records.values import StoredEstimate, StoredPress, TargetRecord


HARDNESS, TARGET, BALL = "hardness", "target", "ball"
PLACE = "place an object under the virtual probe."
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
    if camera.choice.is_virtual and not (camera.choice.is_sphere and camera.running):
        return (PLACE,)
    stopped = "start the camera; it is stopped."
    results = [] if camera.running else [f"wait; the console is {state.busy}." if state.busy else stopped]
    if camera.running and camera.lost:
        results.append("wait until the camera is back; it is away.")
    if not state.calibration_identity:
        results.append("activate a calibration, on the page Camera; there is none (the page Calibrate makes one).")
    elif not responds or not (scaled or camera.choice.is_virtual):  # whose scale is known
        lacking = "size of a pixel" if responds else "response to pressure"
        results.append(f"choose another calibration; {state.calibration!r} lacks the {lacking}.")
    if state.role not in (TARGET, BALL):
        results.append(f"choose what is pressed, the target or a ball; now it is “{ROLE_NAMES[state.role]}”.")
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

    def __init__(self, viewer: Viewer) -> None:
        self._viewer = viewer
        panel = ui.element("section").classes("panel stack hardness-result").props('aria-label="Result"')
        self._panel = widgets.Redrawn(panel.set_visibility(False))

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
            with widgets.title_row(page.title):
                ui.link(f"Report and export of target {saved.number}", f"/records/{saved.number}")
            if not saved.is_current:
                ui.label("New presses were saved: estimate again to include them.").classes("doubtful")
            with ui.element("div").classes("hardness-report"):
                with ui.element("div").classes("stack"):
                    widgets.cards(page.cards)
                    for item in page.tables:
                        widgets.table(item)
                    widgets.message_list(page.notes)
                with ui.element("div").classes("hardness-figures"):
                    for parts in zip(page.pictures, sources, strict=True):
                        widgets.figure(*parts)
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
    return page, widgets.drawings(page)


BARE = "tsis-direct"  # the probe of the catalog that touches objects without tissue between


class ObjectPart:
    """Shows and changes the measured object."""

    def __init__(self, instrument: Instrument, viewer: Viewer, controls: widgets.OperatorControls) -> None:
        self._instrument, self._viewer = instrument, viewer
        self._filled: object = None
        with ui.element("div").classes("panel stack tight"):
            with widgets.title_row("1  Object"):
                self._target = ui.label().classes("chip")
            with ui.element("div").classes("row") as self._virtual:
                spheres = list(list_spheres())
                self._sphere = widgets.select_field(spheres, value=spheres[0], label="Virtual sphere")
                self._sphere.classes("hardness-sphere")
                self._lay = controls.add(
                    widgets.button(
                        "Place it under the probe", self._laid, icon="vertical_align_bottom", look="unelevated"
                    )
                )
            with ui.element("div").classes("row") as self._real:
                self._name = widgets.muted()
                controls.add(widgets.button("Another object", self._another, icon="add"))
            with ui.element("div").classes("row") as self._size:
                self.radius_field = widgets.unit_field("Radius of the object", unit="mm").classes("hardness-number")
                self.sd_field = widgets.unit_field("Its standard uncertainty", unit="mm").classes("hardness-number")
            self._message = widgets.muted()

    def show(self, state: InstrumentState, saved: SavedPresses) -> None:
        """Show the instrument's object; known values of a virtual one are filled in once."""
        choice = state.camera.choice
        self._virtual.set_visibility(choice.is_virtual)
        self._real.set_visibility(not choice.is_virtual)
        self._name.text = state.camera.name or widgets.camera_line(state)
        self._target.text = f"target {state.target}"
        subject = self._instrument.camera_controller.subject
        written = None if subject is None else subject.written_radius_mm
        self._size.set_visibility(written is not None or not choice.is_virtual)
        if written is not None:
            self._fill((choice, written), written, RADIUS_SD_MM)
            self._message.text = f"{choice.phantom} is under {choice.probe}; its radius was measured with a calliper."
        elif not choice.is_virtual:
            self._message.text = "Leave both empty if unknown; the intervals are then wider."
            options = {} if saved.estimate is None else saved.estimate.options
            if "radius_mm" in options:  # as it was typed for the last estimate
                self._fill((choice, saved.number), options["radius_mm"], options.get("radius_sd_mm"))
        else:
            self._message.text = ""

    def show_next(self, placing: bool) -> None:
        """Say whether placing an object is the next step."""
        widgets.set_filled(self._lay, placing)

    def radius(self) -> dict[str, float]:
        """The typed options of an estimate; `InputError` when they cannot be of an object under this probe."""
        radius_text, sd_text = ((each.value or "").strip() for each in (self.radius_field, self.sd_field))
        if not radius_text:
            if sd_text:
                requirement = "must be given with its standard deviation"
                raise InputError(name="radius_mm", requirement=requirement, value="none")
            return {}
        radius = widgets.typed_number("radius_mm", radius_text)
        calibration = self._instrument.calibration
        name = "" if calibration is None else calibration.calibration.probe
        name = name or self._instrument.camera_controller.choice.probe
        require_radius("radius_mm", load_probe(name), radius)
        if not sd_text:
            return {"radius_mm": radius}
        sd = widgets.typed_number("radius_sd_mm", sd_text)
        require_number("radius_sd_mm", sd, 0.0, radius / 10, hint="millimetres, up to a tenth of the radius")
        return {"radius_mm": radius, "radius_sd_mm": sd}

    def _fill(self, which: object, radius_mm: float, sd_mm: float | None) -> None:
        if which != self._filled:
            self._filled = which
            self.radius_field.set_value(f"{radius_mm:.3f}")
            self.sd_field.set_value(widgets.number_text_of_field(sd_mm))

    async def _laid(self) -> None:
        with widgets.loading(self._lay):
            await self._viewer.attempt(self._lay_under, str(self._sphere.value))

    def _lay_under(self, sphere: str) -> None:
        by, seed = self._viewer.identity, self._instrument.camera_controller.choice.seed
        self._instrument.choose(CameraChoice(probe=BARE, phantom=sphere, seed=seed), by=by)
        self._choose_free_target()
        self._instrument.start(by=by)
        if self._instrument.calibration is None:  # the chosen one is of tissue; it is back with the tissue
            self._instrument.use_calibration(None, by=by)

    async def _another(self) -> None:
        await self._viewer.attempt(self._choose_free_target)

    def _choose_free_target(self) -> None:
        number = next_free(self._instrument.store, self._instrument.state().target)
        self._instrument.set_target(number, by=self._viewer.identity)


class PressList:
    """The presses of the next estimate, and the radius of the ball, which shows how much the probe itself yields."""

    def __init__(self) -> None:
        self._list = widgets.Redrawn(ui.element("ol").classes("hardness-presses"))
        self._none = widgets.muted(f"None yet; {PRESSES} at different forces are best.")
        with ui.element("div").classes("row") as self._ball:
            radius = widgets.number_text_of_field(BALL_MM)
            self.ball_mm = widgets.unit_field("Radius of the ball", radius, unit="mm").classes("hardness-number")
            widgets.muted("A rigid ball shows how much the probe itself yields.")

    def show(self, saved: SavedPresses, role: str) -> None:
        """Show the presses; the radius where a ball is or was pressed."""
        self._ball.set_visibility(role == BALL or any(press.role == BALL for press in saved.presses))
        lines = tuple(press_text(press) for press in saved.presses)
        if self._list.changes_to(lines):
            self._none.set_visibility(not lines)
            with self._list.element:
                for line in lines:
                    widgets.list_message(line)

    def ball_radius(self) -> float:
        """The typed radius in mm; `InputError` when it is no number."""
        return widgets.typed_number("reference_radius_mm", self.ball_mm.value)


def press_text(press: StoredPress) -> str:
    """A press in a line."""
    where = "Object" if press.role == TARGET else "Rigid ball"
    against = f"; {'; '.join(map(flag_text, press.flags))}" if press.flags else ""
    return f"{where}, {widgets.force_text(press.force_n)}, saved at {widgets.time_label(press.taken)}{against}"


LABELS = {
    "radius_mm": "radius of the object",
    "radius_sd_mm": "its standard deviation",
    "reference_radius_mm": "radius of the ball",
}


class Estimating:
    """Begins the estimate, with the typed radii."""

    def __init__(self, instrument: Instrument, viewer: Viewer, measured: ObjectPart, presses: PressList) -> None:
        self._instrument, self._viewer, self._object, self._presses = instrument, viewer, measured, presses
        with ui.element("div").classes("panel stack tight"):
            with widgets.title_row("3  Estimate"):
                self.report = ReportButton(viewer)
                self._button = widgets.button("Estimate", self.begin, icon="analytics", look="unelevated")
            self._bar = widgets.ProgressBar("Progress of the estimate")
            self._message = widgets.status()

    def show(self, job: JobState | None, *, enough: bool, two: bool, filled: bool) -> None:
        """Show whether it can begin, whether it is the next step, and how far it is."""
        running = job is not None and job.running
        failed = job is not None and job.status == FAILED
        self._button.set_enabled(enough and not running)
        widgets.set_filled(self._button, filled)
        self._bar.show(job)
        if running:
            text = "The contact of a probe that was never used before is solved once, which takes some minutes."
        elif job is not None and failed:
            text = with_field_labels(job.sentence, LABELS)
        else:
            text = "" if two or not enough else "One press is nearly as precise, but nothing tests it."
        self._message.text = text
        widgets.set_class(self._message, "doubtful", failed)

    async def begin(self) -> None:
        """Estimate the hardness of the present object."""

        def begin() -> Job:
            number = self._instrument.state().target
            presses = saved_presses(self._instrument.store, number).presses
            options = self._object.radius()
            if any(press.role == BALL for press in presses):
                options["reference_radius_mm"] = self._presses.ball_radius()
            identities = [press.id for press in presses] or None
            return self._instrument.estimate(number, kind=HARDNESS, presses=identities, options=options)

        fields = {"radius_mm": self._object.radius_field, "radius_sd_mm": self._object.sd_field}
        await widgets.submit(self._viewer, {**fields, "reference_radius_mm": self._presses.ball_mm}, begin)


EVERY_S = 0.5  # between two readings of the store


class HardnessPage:
    """The parts of the page, and what they show."""

    def __init__(self, instrument: Instrument, viewer: Viewer) -> None:
        self._instrument, self._viewer = instrument, viewer
        self._state: InstrumentState | None = None
        self._results = SavedPresses(number=0)
        self._mark: object = None
        self._trouble = ""
        self._controls = widgets.OperatorControls(viewer)
        with ui.element("div").classes("panel hardness-next"):
            self._next = ui.label().classes("strong").props("role=status")
            self._controls.why()
        with ui.element("div").classes("split examine hardness"):
            with ui.element("section").classes("stack").props('aria-label="Live image"'):
                self._live = LivePanel(instrument)
            with ui.element("section").classes("stack").props('aria-label="Steps"'):
                self._object = ObjectPart(instrument, viewer, self._controls)
                with ui.element("div").classes("panel stack tight"):
                    with widgets.title_row("2  Presses"):
                        self._take = TakeButton(instrument, viewer)
                        self._controls.add(self._take.element)
                    self._press = PressPanel(instrument, viewer, self._controls)
                    with self._press.force_row:
                        self._force = ForceRow()
                    self._flags = FlagList()
                    self._presses = PressList()
                self._estimating = Estimating(instrument, viewer, self._object, self._presses)
        self._result = HardnessPanel(viewer)
        act_on_keys(self._live, self._press, self._estimating.begin, self._estimating.report.save)
        viewer.every(EVERY_S, self._refresh)
        viewer.every(MEASURE_EVERY_S, self._live.frames.tools.refresh)
        viewer.follow(self._show)

    def _show(self, state: InstrumentState) -> None:
        self._state = state
        for part in (self._live, self._controls, self._force, self._flags):
            part.show(state)
        self._notify(state)

    async def _refresh(self) -> None:
        """Read the store after a possible change, also by another tab or a script."""
        state = self._state = self._state or self._instrument.state()
        self._controls.show(state)  # a client that was away for a moment may own the camera again
        touches = not state.camera.choice.is_virtual or state.camera.choice.is_sphere
        try:
            now = (await self._viewer.entries(), state.target, touches)
            if now == self._mark:
                return
            result = await run.io_bound(saved_presses, self._instrument.store, state.target)
        except TsisError as error:
            self._mark, self._trouble = None, str(error)
            self._notify(self._state or state)
            return
        if result is None:  # the console is shutting down
            return
        if not touches and result.estimate is None:  # presses on the virtual tissue give no hardness
            result = replace(result, presses=())
        self._mark, self._results, self._trouble = now, result, ""
        self._notify(self._state or state)
        await self._result.show(result)

    def _notify(self, state: InstrumentState) -> None:
        """Say what is to be done next; while a target was not yet read, that it is being read."""
        read = self._results.number == state.target
        result = self._results if read else SavedPresses(number=state.target)
        self._object.show(state, result)
        self._presses.show(result, state.role)
        active = state.active
        missing = missing_text(
            state,
            scaled=active is not None and active.calibration.scale is not None,
            responds=active is not None and active.calibration.response is not None,
        )
        job = widgets.estimate_job(state)
        running = job is not None and job.running
        text = next_step_text(result, missing, estimating=running) if read else f"Target {state.target} is being read."
        self._next.text = self._trouble or text
        enough, pressing = len(result.on_object) >= PRESSES, not missing and len(result.on_object) < PRESSES
        placing = missing == (PLACE,)
        main = "object" if placing else "presses" if pressing else "camera"
        self._press.show(state, main=main, possible=not missing)
        self._take.element.set_visibility(not missing and state.camera.choice.is_virtual)
        self._object.show_next(placing)
        widgets.set_filled(self._take.element, pressing)
        self._estimating.report.show(result.number if result.estimate is not None else None)
        self._estimating.show(job, enough=bool(result.on_object), two=enough, filled=enough and not result.is_current)
