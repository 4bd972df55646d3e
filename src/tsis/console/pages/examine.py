"""Examine: the live image, the press, the estimate."""

from __future__ import annotations

import asyncio
import math
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from nicegui import run, ui
from nicegui.element import Element

from tsis.__about__ import LARGEST_TARGET
from tsis.console import widgets
from tsis.console.live.hub import FIRST_MAP
from tsis.console.live.panel import FramePanel
from tsis.console.live.press_curve import PressCurve
from tsis.console.live.view import LiveView, SurfaceView
from tsis.console.messages import FORCE, field_messages, plain_message
from tsis.console.pages.records import ReportButton, flag_text
from tsis.console.services.captures import MOST_SEQUENCE_FRAMES
from tsis.console.services.choice import PLAIN, CameraChoice
from tsis.console.services.jobs import FAILED, tissue_title
from tsis.console.services.memory import LIGHT_N
from tsis.errors import TsisError
from tsis.instrument.camera import PRESETS
from tsis.model.require import require_integer
from tsis.present.hardness import estimate_cards, estimate_messages_of, estimate_table_of
from tsis.present.inclusion import estimate_pictures
from tsis.present.page import address
from tsis.present.target import time_text
from tsis.records.importing import target_by_number
from tsis.records.values import ESTIMATES, ROLE_NAMES

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Mapping, Sequence

    from nicegui.events import GenericEventArguments, ValueChangeEventArguments

    from tsis.console.services.captures import SavedPress
    from tsis.console.services.frames import FrameAnalysis
    from tsis.console.services.instrument import Instrument
    from tsis.console.services.jobs import Job, JobState
    from tsis.console.services.memory import TissueReading
    from tsis.console.services.state import InstrumentState
    from tsis.console.viewer import Viewer
    from tsis.instrument.camera import Setting
    from tsis.model.estimate import Estimate
    from tsis.present.page import Picture
    from tsis.records.store import Store
    from tsis.records.values import StoredEstimate, StoredPress, Target

    Act = Callable[[], Awaitable[object]]


STEPS = 200  # of a slider
UNITS_IN_NAMES = ("_ms", "_db", "_s", "_n")


class SettingLine:
    """One setting of the camera, changed by ``adjust``."""

    def __init__(
        self, setting: Setting, adjust: Callable[[float], object], viewer: Viewer, controls: widgets.OperatorControls
    ) -> None:
        self._setting, self._adjust, self._viewer = setting, adjust, viewer
        self._slider: ui.slider | None = None
        self._moving = False
        text = setting_label(setting.name)
        with ui.element("div").classes("setting"):
            ends = f"{setting.low:g} to {setting.high:.4g} {setting.unit}".strip()
            about = f"{text} of the camera: {ends}."
            self._field = widgets.NumberField(viewer, text, adjust, about=about, unit=setting.unit)
            controls.add(self._field.element)
            if math.isfinite(setting.low) and math.isfinite(setting.high) and setting.low < setting.high:
                span = setting.high - setting.low
                self._slider = ui.slider(min=setting.low, max=setting.high, step=span / STEPS, value=setting.value)
                self._slider.props("dense").props["aria-label"] = text
                self._slider.on("update:model-value", self._changed)
                self._slider.on("change", self._released)
                controls.add(self._slider)
                ui.label(ends).classes("muted range")

    def show(self, value: float) -> None:
        """Show the camera's value, unless another one is being given."""
        self._field.show(value)
        if self._slider is not None and not self._moving and self._slider.value != value:
            self._slider.set_value(value)

    def _changed(self) -> None:
        self._moving = True

    async def _released(self, event: GenericEventArguments) -> None:
        value = min(max(float(event.args), self._setting.low), self._setting.high)
        refusal = await self._viewer.refusal(partial(self._adjust, value))
        self._moving = False
        if refusal is not None:
            self._field.refuse(plain_message(refusal))


def setting_label(name: str) -> str:
    """A setting's name for people: without its unit, which stands behind the number.

    Examples
    --------
    >>> setting_label("exposure_ms"), setting_label("frames_per_s"), setting_label("gain")
    ('Exposure', 'Frames per s', 'Gain')
    """
    if name != "frames_per_s":
        for ending in UNITS_IN_NAMES:
            name = name.removesuffix(ending)
    return name.replace("_", " ").capitalize()


PRESET_TEXTS = {"default": "As the camera came", "minimal": "Darkest"}


class SettingsPanel:
    """One slider and one field per setting; changes from elsewhere appear."""

    def __init__(self, instrument: Instrument, viewer: Viewer, controls: widgets.OperatorControls) -> None:
        self._instrument, self._viewer, self._controls = instrument, viewer, controls
        self._lines: dict[str, SettingLine] = {}
        with ui.element("div").classes("row"):
            for name in PRESETS:
                act = viewer.command(instrument.preset, name)
                with controls.add(widgets.button(name.capitalize(), act, look="outline dense")):
                    ui.tooltip(PRESET_TEXTS[name])
        self._container = widgets.Redrawn(ui.element("div").classes("settings"))
        self._none = widgets.muted("Start the camera to adjust it.")

    def show(self, state: InstrumentState) -> None:
        """Show the camera's settings."""
        settings = state.camera.settings
        shape = tuple((setting.name, setting.low, setting.high, setting.unit) for setting in settings)
        if self._container.changes_to(shape):
            with self._container.element:
                self._lines = {
                    setting.name: SettingLine(
                        setting, partial(self._adjust, setting.name), self._viewer, self._controls
                    )
                    for setting in settings
                }
        self._none.set_visibility(not settings)
        self._none.text = "The camera is away." if state.camera.lost else "Start the camera to adjust it."
        for setting in settings:
            self._lines[setting.name].show(setting.value)

    def _adjust(self, name: str, value: float) -> None:
        with field_messages({name: setting_label(name).lower()}):
            self._instrument.adjust(name, value, by=self._viewer.identity)


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
    begun = [] if not saved.presses else [item.made for item in saved.estimates if item.made >= saved.presses[0].taken]
    steps = (
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
            title="Reference press",
            done=PLAIN in saved.roles,
            cure="Press tissue without an inclusion, and save a snapshot.",
            role=PLAIN,
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
            done=bool(begun) and {"target", "target" if sphere else PLAIN} <= saved.roles,
            cure="Measure the hardness." if sphere else "Estimate, or save more presses first.",
            address="/hardness" if sphere else "",
        ),
        WorkStep(
            name="report",
            title="Report",
            done=False,
            cure="Save the report.",
        ),
    )
    return tuple(step for step in steps if not sphere or step.name != "reference")  # a ball is for soft probes alone


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

    def __init__(self, instrument: Instrument, viewer: Viewer, controls: widgets.OperatorControls) -> None:
        self._instrument, self._viewer, self._controls = instrument, viewer, controls
        self._saved: SavedTarget | None = None
        self._role = ""
        self.main = "camera"
        self._first = widgets.Redrawn(ui.element("div"))
        with ui.element("section").classes("panel work") as strip:
            strip.props["aria-label"] = "Order of work"
            self._steps = widgets.Redrawn(ui.element("ol").classes("work-steps"))
            with ui.element("div").classes("row"):
                self._cure = widgets.status()
                self._choose = widgets.button("Switch to the target", self._choose_role, look="unelevated dense")
                self._choose.set_visibility(False)
                self._take = TakeButton(instrument, viewer).element
                controls.add(self._choose, self._take)

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
        self._choose.text = "Switch to the target" if self._role == "target" else "Switch to the reference"
        self._cure.text = f"Next: {step.cure}"
        choice = state.camera.choice
        by_itself = choice.is_virtual and bool(step.role) and not first
        self._take.set_visibility(by_itself)
        self._choose.set_visibility(bool(self._role) and not by_itself)
        self.main = "first" if first else "take" if by_itself else "role" if self._role else step.name

    def _say_what_this_is(self) -> None:
        with widgets.panel("What this is"):
            ui.label(WHAT_THIS_IS).classes("wordy")
            with ui.element("div").classes("row"):
                self._controls.add(
                    widgets.button("Try the virtual probe", self._try_virtual, icon="science", look="unelevated")
                )
                for text, icon, address in (
                    ("Connect a camera", "videocam", "/camera"),
                    ("Open my images", "folder_open", "/images"),
                ):
                    widgets.button(text, partial(ui.navigate.to, address), icon=icon)

    async def _try_virtual(self) -> None:
        await self._viewer.attempt(self._start_virtual)

    def _start_virtual(self) -> None:
        if not self._instrument.camera_controller.choice.is_virtual:
            self._instrument.choose(CameraChoice(), by=self._viewer.identity)
        self._instrument.start(by=self._viewer.identity)

    async def _choose_role(self) -> None:
        role = self._role
        await self._viewer.attempt(lambda: self._instrument.hold(role=role, by=self._viewer.identity))


class TakeButton:
    """Has the virtual probe make all presses of a target."""

    def __init__(self, instrument: Instrument, viewer: Viewer) -> None:
        self._instrument, self._viewer = instrument, viewer
        self.element = widgets.button("Take the presses", self._take, look="unelevated dense")
        self.element.tooltip("The virtual probe presses target and reference with two forces, and saves each press.")

    async def _take(self) -> None:
        with widgets.loading(self.element):
            saved = await self._viewer.attempt(self._instrument.take_presses, by=self._viewer.identity)
        if saved:
            self._viewer.notify(f"Saved {widgets.count_text(len(saved), 'press')} of target {saved[0].target.number}.")


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

    def __init__(self, instrument: Instrument, viewer: Viewer, controls: widgets.OperatorControls) -> None:
        self._instrument, self._viewer, self._controls = instrument, viewer, controls
        with ui.element("div").classes("row tissue"):
            act = viewer.command(instrument.read_tissue)
            self._read = widgets.button("Measure the tissue", act, icon="straighten", look="outline dense")
            with controls.add(self._read):
                ui.tooltip(f"One light press on tissue without an inclusion, at about {LIGHT_N} N.")
            self._message = widgets.status("muted wordy")
            self._forces = widgets.Redrawn(ui.element("div").classes("row"))

    def show(self, state: InstrumentState) -> None:
        """Show the tissue of the present target, and how far its reading is."""
        title = tissue_title(state.target)
        job = next((job for job in reversed(state.jobs) if job.title == title), None)
        self._read.set_visibility(not state.camera.choice.is_sphere)
        self._message.text = tissue_text(state.tissue, job)
        widgets.set_class(self._message, "doubtful", job is not None and job.status == FAILED)
        if self._forces.changes_to(state.tissue):
            with self._forces.element:
                for force_n in () if state.tissue is None else state.tissue.forces_n:
                    self._controls.add(
                        widgets.button(f"{force_n:g} N", partial(self._press, force_n), look="outline dense")
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

    def __init__(self, instrument: Instrument, viewer: Viewer, on_saved: Callable[[SavedTarget], None]) -> None:
        self._instrument, self._viewer, self._on_saved = instrument, viewer, on_saved
        self._state: InstrumentState | None = None
        self._drawn: dict[str, tuple[tuple[Picture, str], ...]] = {}  # by the estimate's identity
        with ui.element("div").classes("row"):
            self._title = widgets.panel_title("Target")
            ui.element("div").classes("spring")
            self._target = ui.link("Open the target", "/records")
            self._report = ReportButton(viewer)
            self._hardness = ui.link("Hardness of this object", "/hardness")
            self._begin = widgets.button("Estimate", self.estimate, icon="analytics")
        self._bar = widgets.ProgressBar("Progress of the estimate")
        self._message = widgets.status("muted wordy")
        self._record = widgets.Redrawn(ui.element("div").classes("stack"))
        viewer.every(EVERY_S, self._refresh)

    def show(self, state: InstrumentState, *, main: str) -> None:
        """Show how far the estimate is; ``main`` as of `WorkOrder`."""
        self._state = state
        job = widgets.estimate_job(state)
        sphere = state.camera.choice.is_sphere  # its estimate asks for more than presses
        self._hardness.set_visibility(sphere)
        self._begin.set_visibility(not sphere)
        self._begin.set_enabled(job is None or not job.running)
        widgets.set_filled(self._begin, main == "estimate")
        widgets.set_filled(self._report.element, main == "report")
        self._bar.show(job)
        self._message.text = job_text(job)
        widgets.set_class(self._message, "doubtful", job is not None and job.status == FAILED)

    async def estimate(self) -> None:
        """Estimate the present target."""
        await self._viewer.attempt(self._instrument.estimate, self._instrument.state().target)

    async def report(self) -> None:
        """Save the report of the present target."""
        await self._report.save()

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
        self._target.set_visibility(saved.target is not None)
        self._target.props["href"] = f"/records/{saved.number}"
        self._report.show(saved.number if saved.target is not None else None)
        self._on_saved(saved)
        with self._record.element:
            for stored in saved.estimates:
                truth = {} if saved.target is None else saved.target.truth
                widgets.cards(estimate_cards(stored, truth))
                with ui.expansion("All numbers").props("dense"):
                    widgets.table(estimate_table_of(stored, truth))
                with ui.element("div").classes("estimate-figures"):
                    for item in self._drawn.get(stored.id, ()):
                        widgets.figure(*item)
                widgets.message_list(estimate_messages_of(stored))
            for message in saved.damaged:
                ui.label(f"Left out: {message}.").classes("doubtful")
            presses(saved)


def presses(saved: SavedTarget) -> None:
    """The newest presses, one line each."""
    if not saved.count:
        widgets.muted("No presses of this target yet. Press it and save a snapshot (space bar).")
        return
    more = "" if saved.count <= len(saved.presses) else f", the last {len(saved.presses)}"
    count = widgets.count_text(saved.count, "press")
    with widgets.rows_under(("Pressed", "Force", "Saved at (UTC)", "Flags"), caption=count + more):
        for press in saved.presses:
            flags = "; ".join(map(flag_text, press.flags))
            widgets.row((ROLE_NAMES[press.role], widgets.force_text(press.force_n), time_text(press.taken), flags))


def job_text(job: JobState | None) -> str:
    """How far it is, or why it failed."""
    if job is None:
        return ""
    if job.running:
        progress = f", {job.done} of {job.total} steps" if job.total else ""
        return f"Estimating{progress}; the mechanics of a probe are solved once and cached."
    return job.sentence if job.status == FAILED else ""


SOURCES = {"gauge": "from the gauge", "virtual": "(simulated)", "typed": "(typed)"}


class ForceRow:
    """Force and whether the press has settled, on one line."""

    def __init__(self) -> None:
        self._force = ui.label().classes("number")
        self._source = widgets.muted()
        ui.element("div").classes("spring")
        self._still = ui.label().classes("chip still")

    def show(self, state: InstrumentState) -> None:
        """Show the newest analysis."""
        analysis = present(state)
        force = None if analysis is None else analysis.force
        self._force.text = "" if force is None else f"{force.value_n:.2f} N"
        self._source.text = widgets.force_text(None) if force is None else SOURCES[force.source]
        self._still.text = "" if analysis is None or not analysis.still else analysis.still
        self._still.set_visibility(bool(self._still.text))
        widgets.set_class(self._still, "good", analysis is not None and analysis.still == "settled")


class FlagList:
    """Flags of the press, with advice."""

    def __init__(self) -> None:
        self._list = widgets.Redrawn(ui.element("ul").classes("flags").props('aria-label="Flags of this press"'))

    def show(self, state: InstrumentState) -> None:
        """Show the flags of the newest analysis; an unchanged list stays, so that screen readers do not repeat it."""
        named = flags(present(state))
        if self._list.changes_to(named):
            with self._list.element:
                for name, advice in named:
                    with ui.element("li"):
                        ui.label(name).classes("flag" if advice else "good")
                        widgets.muted(advice)


def present(state: InstrumentState) -> FrameAnalysis | None:
    """The present analysis; None while the camera is stopped or away."""
    return state.frame_analysis if state.camera.running and not state.camera.lost else None


def flags(analysis: FrameAnalysis | None) -> tuple[tuple[str, str], ...]:
    """Names of the flags with their advice; one line without advice when there are none."""
    if analysis is None:
        return ()
    return tuple((flag.name, flag.advice) for flag in analysis.flags) or (("No flags.", ""),)


class Shortcut(NamedTuple):
    """A key as its event names it, what stands on it, what it does, and the event of `Keys` with its value."""

    key: str
    cap: str
    does: str
    event: str
    value: int | None = None


SHORTCUTS = (  # the page's keys and its help are made from these
    Shortcut(" ", "Space", "save a snapshot", "snapshot"),
    Shortcut("ArrowLeft", "←", "previous target", "step", -1),
    Shortcut("ArrowRight", "→", "next target", "step", 1),
    Shortcut("n", "N", "type the force; Space then saves", "force"),
    Shortcut("1", "1", "press the target", "role", 0),
    Shortcut("2", "2", "press the reference", "role", 1),
    Shortcut("s", "S", "start or stop the camera", "run"),
    Shortcut("e", "E", "estimate", "estimate"),
    Shortcut("r", "R", "save the report", "report"),
    Shortcut("f", "F", "live image alone, and back", "alone"),
)


class Keys(Element, component="keys.js"):
    """Receives keys while the page has the focus outside its fields; F shows ``alone``, N goes to the field ``force``.

    ``acts`` are called for the other events, with the value of the key where it has one.
    """

    def __init__(self, *, alone: Element, force: Element, acts: Mapping[str, Callable[..., Awaitable[Any]]]) -> None:
        super().__init__()
        self._props["alone"], self._props["force"] = alone.html_id, force.html_id
        self._props["keys"] = {item.key: [item.event, item.value] for item in SHORTCUTS}
        values = {item.event: {each.value for each in SHORTCUTS if each.event == item.event} for item in SHORTCUTS}

        def on(event: str, act: Callable[..., Awaitable[Any]]) -> None:
            async def received(message: GenericEventArguments) -> None:
                if values[event] == {None}:
                    await act()
                elif message.args in values[event]:  # a browser may send anything
                    await act(message.args)

            self.on(event, received)

        for event, act in acts.items():
            on(event, act)


def act_on_keys(live: LivePanel, press: PressPanel, estimate: Act, report: Act) -> None:
    """Have the page's keys act on its live image, its press, its estimate and its report."""
    acts: dict[str, Callable[..., Awaitable[object]]] = {
        "snapshot": press.snapshot,
        "step": press.step,
        "role": press.choose_role,
        "run": press.run.click,
        "estimate": estimate,
        "report": report,
    }
    Keys(alone=live.single, force=press.force.element, acts=acts)


MEASURE_EVERY_S = 0.3  # the newest frame


class LivePanel:
    """The live image with its tools, beside it a relief on request."""

    def __init__(self, instrument: Instrument, *, map_name: str = FIRST_MAP) -> None:
        self._surface: SurfaceView | None = None
        with ui.element("div").classes("panel live-panel") as self.single:
            self.frames = FramePanel(
                lambda name: LiveView(map_name=name), instrument.newest_image, self._shown, map_name=map_name
            )
            self.view = self.frames.view
            with self.frames.switches:
                ui.switch("Freeze", value=False, on_change=lambda event: self.view.freeze(bool(event.value)))
                ui.switch("Contact", value=True, on_change=lambda event: self.view.overlay(bool(event.value)))
                ui.switch("3-D", value=False, on_change=self._three)
                ui.element("div").classes("spring")
                alone = ui.button(icon="fullscreen").props('flat dense round aria-label="Full screen"')
                # What F does too; in the browser, where only a click may fill the screen.
                alone.on("click", js_handler="() => document.dispatchEvent(new CustomEvent('tsis-alone'))")
            with self.frames.beside:
                self._surface_container = ui.element("div").classes("surface-place")
            self._surface_container.set_visibility(False)
            self._camera = ui.label().classes("muted camera-line")

    def show(self, state: InstrumentState) -> None:
        """Show the camera's state; the frames come over their own connection."""
        self.view.update_state(state)
        self.frames.range.show(state.frame_analysis, state.camera.full_scale)
        if self._surface is not None:
            self._surface.update_state(state)
        self._camera.text = widgets.camera_line(state)

    def _shown(self, map_name: str, ends: tuple[float, float], gamma: float) -> None:
        if self._surface is not None:
            self._surface.colour(map_name)
            self._surface.ends(ends, gamma)

    def _three(self, event: ValueChangeEventArguments[bool | None]) -> None:
        self._surface_container.set_visibility(bool(event.value))
        widgets.set_class(self.frames.beside, "two", bool(event.value))
        self._surface_container.clear()
        self._surface = None
        if event.value:
            with self._surface_container:
                self._surface = SurfaceView()
            self.frames.apply()


def examine_page(instrument: Instrument, viewer: Viewer) -> None:
    """Build the page."""
    latest: InstrumentState | None = None

    def saved(target: SavedTarget) -> None:
        order.saved(target)
        if latest is not None:
            show(latest)

    controls = widgets.OperatorControls(viewer)
    with ui.element("div").classes("stack work-place"):
        order = WorkOrder(instrument, viewer, controls)
    with ui.element("div").classes("split examine"):
        with ui.element("section").classes("stack").props('aria-label="Live image"'):
            live = LivePanel(instrument)
        with ui.element("section").classes("stack").props('aria-label="Press, estimate and camera"'):
            with ui.element("div").classes("panel stack tight"):
                press = PressPanel(instrument, viewer, controls)
                with press.force_row:
                    force = ForceRow()
                tissue = TissueRow(instrument, viewer, controls)
                flags = FlagList()
                controls.why()
            with ui.element("div").classes("panel"):
                curve = PressCurve()
            with ui.element("div").classes("panel under-tabs"):
                with ui.tabs().props("dense no-caps align=left") as tabs:
                    reported, set_up, recorded = (ui.tab(name) for name in ("Estimate", "Settings", "Sequence"))
                with ui.tab_panels(tabs, value=reported).props("keep-alive").classes("plain-panels"):
                    with ui.tab_panel(reported):
                        estimate = EstimatePanel(instrument, viewer, saved)
                    with ui.tab_panel(set_up):
                        settings = SettingsPanel(instrument, viewer, controls)
                    with ui.tab_panel(recorded):
                        sequence = SequencePanel(instrument, viewer, controls)
    act_on_keys(live, press, estimate.estimate, estimate.report)

    def show(state: InstrumentState) -> None:
        nonlocal latest
        latest = state
        order.show(state)
        curve.show(instrument.moments(), state.camera.mm_per_pixel)
        press.show(state, main=order.main)
        estimate.show(state, main=order.main)
        for part in (live, force, tissue, flags, settings, sequence, controls):
            part.show(state)

    viewer.follow(show)
    viewer.every(MEASURE_EVERY_S, live.frames.tools.refresh)


TO_PRESS = ("calibration", "reference", "presses")  # steps for which a snapshot is the next thing


class PressPanel:
    """Controls of a press."""

    def __init__(self, instrument: Instrument, viewer: Viewer, controls: widgets.OperatorControls) -> None:
        self._instrument, self._viewer, self._saving = instrument, viewer, asyncio.Lock()
        with ui.element("div").classes("row snapshot-row"):
            self.run = widgets.RunButton(instrument, viewer)
            self._save = widgets.button("Snapshot", self.snapshot, icon="photo_camera", look="unelevated")
            with ui.element("div").classes("stepper"):
                back = self._stepper("remove", "Previous target", -1)
                self._target = widgets.NumberField(viewer, "Target", self._set_target)
                on = self._stepper("add", "Next target", 1)
        with ui.element("div").classes("row"):
            choice = ui.toggle({}, value=None).props("unelevated toggle-color=primary").classes("roles")
            choice.props('role=group aria-label="Pressed on"')
            self._role = widgets.ChoiceField(
                viewer, choice, lambda role: instrument.hold(role=role, by=viewer.identity)
            )
        with ui.element("div").classes("row") as self.force_row:
            self.force = widgets.NumberField(
                viewer,
                "Force",
                self._hold,
                unit="N",
                emptied=lambda: instrument.forget_force(by=viewer.identity),
            )
        controls.add(self.run.element, self._save, back, on, self._target.element, choice, self.force.element)

    def show(self, state: InstrumentState, *, main: str, possible: bool = True) -> None:
        """Show the instrument's press; ``main`` as of `WorkOrder`; whether it is ``possible`` to save one."""
        self.run.show(state.camera, main=main == "camera")
        self._save.set_visibility(possible)
        widgets.set_filled(self._save, main in TO_PRESS)
        self._target.show(state.target)
        self._role.show(state.role, {role: ROLE_NAMES[role] for role in state.roles})
        self.force.show(state.force_n)

    async def snapshot(self) -> None:
        """Save the press, after a force that was just typed and the snapshots that were asked for before."""
        if not self._save.visible:  # the page says what comes first
            return
        async with self._saving:
            await self.force.taken()
            press: SavedPress | None = await self._viewer.attempt(self._instrument.snapshot, by=self._viewer.identity)
        if press is not None:
            self._viewer.notify(snapshot_text(press))

    async def choose_role(self, position: int) -> None:
        """Press the target, or what it is compared with."""
        role = self._instrument.state().roles[position]
        await self._viewer.attempt(lambda: self._instrument.hold(role=role, by=self._viewer.identity))

    async def step(self, by: int) -> None:
        """Go to the previous or the next target."""
        await self._viewer.attempt(self._instrument.step_target, by, by=self._viewer.identity)

    def _set_target(self, number: float) -> None:
        whole = require_integer("target", number, 1, LARGEST_TARGET, hint="number of the target")
        self._instrument.set_target(whole, by=self._viewer.identity)

    def _hold(self, force_n: float) -> None:
        with field_messages(FORCE):
            self._instrument.hold(force_n=force_n, by=self._viewer.identity)

    def _stepper(self, icon: str, label: str, by: int) -> ui.button:
        button = ui.button(icon=icon, on_click=lambda: self.step(by)).props("flat dense round")
        button.props["aria-label"] = label
        return button


def snapshot_text(saved: SavedPress) -> str:
    """Text of a snapshot."""
    press = saved.press
    against = f"; {'; '.join(map(flag_text, press.flags))}" if press.flags else ""
    notes = "".join(f" {note}." for note in saved.notes)
    role, force = ROLE_NAMES[press.role], widgets.force_text(press.force_n)
    return f"Saved for target {saved.target.number}: {role}, {force}{against}." + notes


SECONDS, FRAMES = "seconds", "frames"
FIRST_LENGTH = 10.0


class SequencePanel:
    """Begin and end a sequence."""

    def __init__(self, instrument: Instrument, viewer: Viewer, controls: widgets.OperatorControls) -> None:
        self._instrument, self._viewer = instrument, viewer
        with ui.element("div").classes("row"):
            self._length = widgets.unit_field("Length", widgets.number_text_of_field(FIRST_LENGTH)).classes(
                "number-field"
            )
            self._unit = ui.toggle({SECONDS: SECONDS, FRAMES: FRAMES}, value=SECONDS).props(
                "unelevated toggle-color=primary"
            )
            self._unit.props('role=group aria-label="Unit of the length"')
            self._begin = widgets.button("Record", self._record, icon="fiber_manual_record")
            self._end = widgets.button("Stop recording", viewer.command(instrument.end_sequence), icon="stop")
        self._bar = widgets.ProgressBar("Progress of the sequence")
        self._message = widgets.status("muted wordy")
        widgets.muted(
            "Every frame is saved unchanged in the workspace; the recording continues when this page is closed."
        )
        controls.add(self._length, self._unit, self._begin, self._end)

    def show(self, state: InstrumentState) -> None:
        """Show how far the sequence is."""
        sequence = state.sequence
        running = sequence is not None and sequence.running
        self._begin.set_visibility(not running)
        self._end.set_visibility(running)
        self._bar.show(sequence)
        self._message.text = sequence_text(sequence)

    async def _record(self) -> None:
        def begin() -> Job:
            length = widgets.typed_number(str(self._unit.value), self._length.value)
            if self._unit.value == SECONDS:
                return self._instrument.begin_sequence(seconds=length, by=self._viewer.identity)
            frames = require_integer("frames", length, 1, MOST_SEQUENCE_FRAMES)
            return self._instrument.begin_sequence(frames=frames, by=self._viewer.identity)

        await widgets.submit(self._viewer, {SECONDS: self._length, FRAMES: self._length}, begin)


def sequence_text(sequence: JobState | None) -> str:
    """How far a sequence is, or what came of it."""
    if sequence is None:
        return ""
    if sequence.running:
        progress = f": {sequence.fraction:.0%}" if sequence.total else ""
        return f"Recording {sequence.title}" + progress
    return f"{sequence.title.capitalize()}: {sequence.sentence}"
