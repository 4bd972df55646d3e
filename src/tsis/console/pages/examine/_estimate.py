"""The order of work on a target, its tissue, its saved presses, and its estimate of an inclusion or of hardness."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from nicegui import run, ui

from tsis.console.pages import components as kit
from tsis.console.services import FAILED, LIGHT_N, CameraChoice, tissue_title
from tsis.errors import TsisError
from tsis.present.hardness import estimate_cards, estimate_messages_of
from tsis.present.inclusion import estimate_pictures
from tsis.present.page import address
from tsis.present.target import time_text
from tsis.records.importing import target_by_number
from tsis.records.values import ESTIMATES, ROLE_NAMES

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from tsis.console.services import Instrument, InstrumentState, JobState, TissueReading
    from tsis.model.estimate import Estimate
    from tsis.present.page import Picture
    from tsis.records.store import Store
    from tsis.records.values import StoredEstimate, StoredPress, Target


SHOWN = 8  # presses, the newest
MOST_COUNTED = 1000  # presses whose roles are looked at


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SavedTarget:
    """A target's number and its stored record."""

    number: int
    target: Target | None = None  # None while nothing is stored
    count: int = 0  # of all presses
    presses: tuple[StoredPress, ...] = ()  # the newest ones, the newest first
    estimates: tuple[StoredEstimate, ...] = ()  # the current ones
    damaged: tuple[str, ...] = ()  # a message for each record that cannot be shown
    roles: frozenset[str] = frozenset()  # of its presses
    first: bool = False  # whether the store has no target yet


def saved_target(store: Store, number: int) -> SavedTarget:
    """Read the target; errors as of the store."""
    if (target := target_by_number(store, number)) is None:
        return SavedTarget(number=number, first=not store.targets(hidden=True))
    count = store.press_count(target)
    record = store.record(target, limit=SHOWN, offset=max(0, count - SHOWN))
    return SavedTarget(
        number=number,
        target=target,
        count=count,
        presses=record.presses[::-1],
        estimates=record.active_estimates,
        damaged=record.damaged,
        roles=frozenset(press.role for press in store.presses(target, limit=MOST_COUNTED)),
    )


def drawn(estimate: Estimate) -> tuple[tuple[Picture, str], ...]:
    """Posterior and section of an estimate with their data addresses; a withheld one says why instead of a number."""
    return tuple((picture, address(picture)) for picture in estimate_pictures(estimate))


REFERENCES = ("plain", "ball")  # roles of reference presses: of tissue, and of spheres


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkStep:
    """A step of the work on a target: its name, whether it is done, what to do, and the page where it is done."""

    name: str
    title: str
    done: bool
    cure: str
    address: str = ""
    role: str = ""  # that the press must have


def work_steps(state: InstrumentState, saved: SavedTarget) -> tuple[WorkStep, ...]:
    """The order of work on the present target, with what is done."""
    camera, sphere = state.camera, state.camera.choice.is_sphere
    reference = next(role for role in state.roles if role in REFERENCES)
    begun = [] if not saved.presses else [item.made for item in saved.estimates if item.made >= saved.presses[0].taken]
    ready = {reference, "target"} <= saved.roles
    return (
        WorkStep(
            name="camera",
            title="Camera",
            done=camera.running and not camera.lost,
            cure="Start the camera.",
            address="/camera",
        ),
        WorkStep(
            name="calibration",
            title="Calibration",
            done=bool(state.calibration),
            cure="Calibrate the probe, or activate its calibration file on the page Camera.",
            address="/calibrate",
        ),
        WorkStep(name="target", title=f"Target {state.target}", done=True, cure=""),
        WorkStep(
            name="reference",
            title="Press on the ball" if sphere else "Reference press",
            done=reference in saved.roles,
            cure="Press the ball of known radius, and save a snapshot."
            if sphere
            else "Press tissue without an inclusion, and save a snapshot.",
            role=reference,
        ),
        WorkStep(
            name="presses",
            title=f"Presses ({saved.count})",
            done="target" in saved.roles,
            cure="Press the target, and save a snapshot. Two forces give more information than one.",
            role="target",
        ),
        WorkStep(
            name="estimate",
            title="Hardness" if sphere else "Estimate",
            done=ready and bool(begun),
            cure="Measure the hardness." if sphere else "Estimate, or save more presses first.",
            address="/hardness" if sphere else "",
        ),
        WorkStep(
            name="report",
            title="Report",
            done=False,
            cure="Open the report.",
            address=f"/records/{saved.number}" if saved.target is not None else "",
        ),
    )


def next_step(steps: Sequence[WorkStep]) -> WorkStep:
    """The first step that is not done; the report is never done."""
    return next(step for step in steps if not step.done)


WHAT_THIS_IS = (
    "tsis measures soft material by touch. A soft, lit probe is pressed on it; a camera sees where the pressure lets "
    "light out; and the program estimates diameter, depth and stiffness of an inclusion, each with its uncertainty. "
    "Without hardware, the virtual probe calculates mechanics, light and camera."
)


class WorkOrder:
    """The order of work: what is done, what is next, and on a first start what this is and where to begin.

    ``main`` names what the page's filled button is: ``"first"``, ``"role"`` for the choice of what is pressed, or the
    next step.
    """

    def __init__(self, instrument: Instrument, viewer: kit.Viewer, controls: kit.OperatorControls) -> None:
        self._instrument, self._viewer, self._controls = instrument, viewer, controls
        self._saved: SavedTarget | None = None
        self._role = ""
        self.main = "camera"
        self._first = kit.Redrawn(ui.element("div"))
        with ui.element("section").classes("panel work") as strip:
            strip.props["aria-label"] = "Order of work"
            self._steps = kit.Redrawn(ui.element("ol").classes("work-steps"))
            with ui.element("div").classes("row"):
                self._cure = kit.status()
                self._choose = kit.button("Switch to the target", self._choose_role, look="unelevated dense")
                self._choose.set_visibility(False)
                controls.add(self._choose)

    def saved(self, saved: SavedTarget) -> None:
        """Take what is stored of the target."""
        self._saved = saved

    def show(self, state: InstrumentState) -> None:
        """Show what is done, and what is next."""
        saved = self._saved
        if saved is None or saved.number != state.target:
            saved = SavedTarget(number=state.target)
        steps = work_steps(state, saved)
        step = next_step(steps)
        if self._steps.changes_to((steps, step)):
            with self._steps.element:
                for item in steps:
                    _step_item(item, here=item is step)
        first = saved.first and not state.camera.running and not state.busy
        if self._first.changes_to(first) and first:
            with self._first.element:
                self._say_what_this_is()
        self._role = step.role if step.role and step.role != state.role else ""
        self._choose.set_visibility(bool(self._role))
        self._choose.text = "Switch to the target" if self._role == "target" else "Switch to the reference"
        self._cure.text = f"Next: {step.cure}"
        self.main = "first" if first else "role" if self._role else step.name

    def _say_what_this_is(self) -> None:
        with kit.panel("What this is"):
            ui.label(WHAT_THIS_IS).classes("wordy")
            with ui.element("div").classes("row"):
                self._controls.add(
                    kit.button("Try the virtual probe", self._try_virtual, icon="science", look="unelevated")
                )
                for text, icon, address in (
                    ("Connect a camera", "videocam", "/camera"),
                    ("Open my images", "folder_open", "/images"),
                ):
                    kit.button(text, partial(ui.navigate.to, address), icon=icon)

    async def _try_virtual(self) -> None:
        await self._viewer.attempt(self._start_virtual)

    def _start_virtual(self) -> None:
        if not self._instrument.camera_controller.choice.is_virtual:
            self._instrument.choose(CameraChoice(), by=self._viewer.identity)
        self._instrument.start(by=self._viewer.identity)

    async def _choose_role(self) -> None:
        role = self._role
        await self._viewer.attempt(lambda: self._instrument.hold(role=role, by=self._viewer.identity))


def _step_item(step: WorkStep, *, here: bool) -> None:
    status = "done" if step.done else "next" if here else "open"
    with ui.element("li").classes("here" if here else "done" if step.done else ""):
        ui.icon("check_circle" if step.done else "arrow_forward" if here else "radio_button_unchecked")
        place = ui.link(step.title, step.address) if step.address else ui.label(step.title)
        place.props["aria-label"] = f"{step.title}: {status}"
        if here:
            place.props["aria-current"] = "step"


class TissueRow:
    """Reads the tissue from a light press, and offers the forces that follow from it."""

    def __init__(self, instrument: Instrument, viewer: kit.Viewer, controls: kit.OperatorControls) -> None:
        self._instrument, self._viewer, self._controls = instrument, viewer, controls
        with ui.element("div").classes("row tissue"):
            act = viewer.command(instrument.read_tissue)
            self._read = kit.button("Measure the tissue", act, icon="straighten", look="outline dense")
            with controls.add(self._read):
                ui.tooltip(f"One light press on tissue without an inclusion, at about {LIGHT_N} N.")
            self._message = kit.status("muted wordy")
            self._forces = kit.Redrawn(ui.element("div").classes("row"))

    def show(self, state: InstrumentState) -> None:
        """Show the tissue of the present target, and how far its reading is."""
        title = tissue_title(state.target)
        job = next((job for job in reversed(state.jobs) if job.title == title), None)
        self._read.set_visibility(not state.camera.choice.is_sphere)
        self._message.text = tissue_text(state.tissue, job)
        kit.set_class(self._message, "doubtful", job is not None and job.status == FAILED)
        if self._forces.changes_to(state.tissue):
            with self._forces.element:
                for force_n in () if state.tissue is None else state.tissue.forces_n:
                    self._controls.add(
                        kit.button(f"{force_n:g} N", partial(self._press, force_n), look="outline dense")
                    )

    async def _press(self, force_n: float) -> None:
        await self._viewer.attempt(partial(self._instrument.hold, force_n=force_n, by=self._viewer.identity))


def tissue_text(tissue: TissueReading | None, job: JobState | None) -> str:
    """What is known of the tissue, or why it is not."""
    if job is not None and job.running:
        return "Measuring the tissue …"
    if job is not None and job.status == FAILED:
        return f"{job.sentence}."
    if tissue is None:
        return ""
    low, high = tissue.interval_kpa
    return f"Tissue {tissue.young_kpa:.2g} kPa (90 % interval {low:.2g} to {high:.2g}). Press target and reference at:"


EVERY_S = 1.0  # between two readings of the store


class EstimatePanel:
    """Saved presses of the target, the button of an estimate, and its result."""

    def __init__(self, instrument: Instrument, viewer: kit.Viewer, on_saved: Callable[[SavedTarget], None]) -> None:
        self._instrument, self._viewer, self._on_saved = instrument, viewer, on_saved
        self._state: InstrumentState | None = None
        self._drawn: dict[str, tuple[tuple[Picture, str], ...]] = {}  # by the estimate's identity
        with ui.element("div").classes("row"):
            self._title = kit.panel_title("Target")
            ui.element("div").classes("spring")
            self._report = ui.link("Report", "/records")
            self._hardness = ui.link("Hardness of this object", "/hardness")
            self._begin = kit.button("Estimate", self._estimate, icon="analytics")
        self._bar = kit.ProgressBar("Progress of the estimate")
        self._message = kit.status("muted wordy")
        self._record = kit.Redrawn(ui.element("div").classes("stack"))
        viewer.every(EVERY_S, self._refresh)

    def show(self, state: InstrumentState, *, main: str) -> None:
        """Show how far the estimate is; ``main`` as of `WorkOrder`."""
        self._state = state
        job = kit.estimate_job(state)
        sphere = state.camera.choice.is_sphere  # its estimate asks for more than presses
        self._hardness.set_visibility(sphere)
        self._begin.set_visibility(not sphere)
        self._begin.set_enabled(job is None or not job.running)
        kit.set_filled(self._begin, main == "estimate")
        kit.set_class(self._report, "filled", main == "report")
        self._bar.show(job)
        self._message.text = job_text(job)
        kit.set_class(self._message, "doubtful", job is not None and job.status == FAILED)

    async def _estimate(self) -> None:
        await self._viewer.attempt(self._instrument.estimate, self._instrument.state().target)

    async def _refresh(self) -> None:
        """Read the store after a possible change, also by another tab or a script."""
        state = self._state = self._state or self._instrument.state()
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
        self._title.text = f"Target {saved.number}" + name
        self._report.set_visibility(saved.target is not None)
        self._report.props["href"] = f"/records/{saved.number}"
        self._on_saved(saved)
        with self._record.element:
            for stored in saved.estimates:
                kit.cards(estimate_cards(stored, {} if saved.target is None else saved.target.truth))
                with ui.element("div").classes("estimate-figures"):
                    for item in self._drawn.get(stored.id, ()):
                        kit.figure(*item)
                kit.message_list(estimate_messages_of(stored))
            for message in saved.damaged:
                ui.label(f"Left out: {message}.").classes("doubtful")
            presses(saved)


def presses(saved: SavedTarget) -> None:
    """The newest presses, one line each."""
    if not saved.count:
        kit.muted("No presses of this target yet. Press it and save a snapshot (space bar).")
        return
    more = "" if saved.count <= len(saved.presses) else f", the last {len(saved.presses)}"
    count = kit.count_text(saved.count, "press")
    with kit.rows_under(("Pressed", "Force", "Saved at (UTC)", "Flags"), caption=count + more):
        for press in saved.presses:
            flags = ", ".join(press.flags)
            kit.row((ROLE_NAMES[press.role], kit.force_text(press.force_n), time_text(press.taken), flags))


def job_text(job: JobState | None) -> str:
    """How far it is, or why it failed."""
    if job is None:
        return ""
    if job.running:
        fraction = f", {job.done} of {job.total} steps" if job.total else ""
        return f"Estimating{fraction}; the mechanics of a probe are solved once and cached."
    return job.sentence if job.status == FAILED else ""
