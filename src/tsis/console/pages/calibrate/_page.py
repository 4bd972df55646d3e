"""The pages of calibration sessions: their list, and one session with its steps."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING
from urllib.parse import quote

from nicegui import run, ui

from tsis.__about__ import LARGEST_SEED
from tsis.calibration.force import TIPS_MM
from tsis.calibration.session import SessionSetup
from tsis.catalog.probes import list_probes
from tsis.console.live import LiveView
from tsis.console.pages import components as kit
from tsis.console.pages.calibrate._steps import CalibrationResultPanel, MakePanel, SavedFrame, StepCard
from tsis.errors import InputError, TsisError
from tsis.model.require import require_integer
from tsis.virtual.calibration_bench import bench_name

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Sequence

    from tsis.console.services import Instrument, InstrumentState
    from tsis.console.services.calibrating import CalibrationSession, SessionSummary, StepState


LIST_EVERY_S, SESSION_EVERY_S = 2.0, 0.3  # between two readings


def calibrate_page(instrument: Instrument, viewer: kit.Viewer) -> None:
    """Build the page."""
    controls = kit.OperatorControls(viewer)
    with ui.element("div").classes("split calibrate-choosing"):
        with kit.panel("Sessions", style="panel"):
            listed = kit.Redrawn(ui.element("div").classes("stack"))
        with kit.panel("Begin a calibration"):
            form = TermsForm(instrument, viewer, controls)
            controls.why()

    async def refresh() -> None:
        sessions = await run.io_bound(instrument.calibrating.listed)
        if sessions is not None and listed.changes_to(sessions):
            with listed.element:
                session_list(sessions)

    def show(state: InstrumentState) -> None:
        form.show(state)
        controls.show(state)

    viewer.every(LIST_EVERY_S, refresh)
    viewer.follow(show)


def session_list(sessions: Sequence[SessionSummary]) -> None:
    """Links to all sessions with their progress."""
    if not sessions:
        kit.muted(
            "None yet. A calibration converts grey levels to newtons and pixels to millimetres. Begin one to be "
            "guided through its steps; it can be interrupted and resumed at any time."
        )
        return
    with ui.element("ul").classes("calibrate-sessions"):
        for item in sessions:
            with ui.element("li"), ui.element("div").classes("row"):
                if item.trouble:
                    ui.label(item.name).classes("strong")
                    ui.label(item.trouble).classes("doubtful")
                    continue
                ui.link(item.title or item.name, f"/calibrate/{quote(item.name)}").classes("strong").mark(
                    f"session {item.name}"
                )
                kit.muted(f"{item.probe}, {item.camera}")
                ui.element("div").classes("spring")
                if item.made:
                    ui.label("calibration made").classes("good")
                else:
                    kit.muted(f"{item.done} of {item.total} steps")


ICONS = {"open": "radio_button_unchecked", "under way": "hourglass_top", "done": "check_circle", "left out": "remove"}


class StepList:
    """Choice of a step, and a button that takes all steps of the virtual rig."""

    def __init__(
        self,
        viewer: kit.Viewer,
        session: CalibrationSession,
        controls: kit.OperatorControls,
        choose: Callable[[str], Awaitable[None]],
    ) -> None:
        self._choose = choose
        self._title = kit.panel_title("Steps")
        self._list = kit.Redrawn(ui.element("ol").classes("calibrate-steps"))
        take_all = kit.button("Do all open steps", viewer.command(session.take_all), icon="fast_forward")
        self._all = controls.add(take_all.classes("calibrate-all"))
        self._automatic = session.rig.by_itself
        self._all.set_visibility(self._automatic)

    def show(self, steps: Sequence[StepState], present: str | None) -> None:
        """Show the progress of each step and mark the present one."""
        now = (present, *((state.step.name, state.status, status_text(state)) for state in steps))
        if not self._list.changes_to(now):
            return
        done = sum(state.status == "done" for state in steps)
        self._title.text = f"Steps: {done} of {len(steps)} done"
        self._all.set_visibility(self._automatic and any(state.status in ("open", "left out") for state in steps))
        with self._list.element:
            for state in steps:
                self._item(state, here=state.step.name == present)

    def _item(self, state: StepState, *, here: bool) -> None:
        name = state.step.name
        with ui.element("li"):
            label = f"Step {name}: {status_text(state)}"
            button = kit.button("", partial(self._choose, name), look="flat", label=label)
            button.props("align=left").classes("calibrate-step here" if here else "calibrate-step")
            if here:
                button.props('aria-current="step"')
            with button:
                ui.icon(ICONS[state.status]).classes(state.status.replace(" ", "-"))
                ui.label(name).classes("calibrate-step-name")
                kit.muted(status_text(state))


def status_text(state: StepState) -> str:
    """How far a step is."""
    if state.status == "done":
        return f"{state.frames} frames"
    if state.forces_n:
        return f"{len(state.forces_n)} forces, not saved"
    if state.status == "open" and state.step.optional:
        return "open, optional"
    return state.status


async def session_page(instrument: Instrument, viewer: kit.Viewer, name: str) -> None:
    """Build the page of the session of that name."""
    position = ui.element("div").classes("stack")
    try:
        session: CalibrationSession | None = await run.io_bound(instrument.calibrating.open, name)
    except TsisError as error:
        with position, ui.element("section").classes("panel"):
            ui.label(str(error)).classes("doubtful")
            ui.link("All sessions", "/calibrate")
        return
    if session is None:  # the console is shutting down
        return
    with position:
        _Guide(instrument, viewer, session)


class _Guide:
    """The parts of a session's page, and the present step."""

    def __init__(self, instrument: Instrument, viewer: kit.Viewer, session: CalibrationSession) -> None:
        self._session = session
        self._controls = kit.OperatorControls(viewer)
        self._chosen: str | None = None
        self._steps: tuple[StepState, ...] = ()
        self._view: LiveView | None = None
        self._state: InstrumentState | None = None
        with ui.element("div").classes("row calibrate-head"):
            ui.link("Sessions", "/calibrate")
            kit.panel_title(session.terms.name)
            kit.muted(setup_text(session))
        with ui.element("div").classes("calibrate-guide"):
            with ui.element("section").classes("panel").props('aria-label="Steps"'):
                self._list = StepList(viewer, session, self._controls, self._choose)
            with ui.element("div").classes("stack"):
                with ui.element("section").classes("panel stack").props('aria-label="Present step"'):
                    self._card = StepCard(viewer, session, self._controls)
                    self._controls.why()
                    with ui.element("div").classes("calibrate-images"):
                        if not session.rig.by_itself:
                            with ui.element("div").classes("calibrate-live"):
                                self._view = LiveView(map_name="grey")
                        self._frame = SavedFrame(viewer, session)
                self._making = MakePanel(instrument, viewer, session, self._controls)
        self._result = CalibrationResultPanel(viewer, session)
        viewer.every(SESSION_EVERY_S, self._refresh)
        viewer.follow(self._show)

    def _show(self, state: InstrumentState) -> None:
        self._state = state
        self._controls.show(state)
        self._making.show(state)
        if self._view is not None:
            self._view.update_state(state)

    async def _refresh(self) -> None:
        session = self._session
        result = await run.io_bound(lambda: (session.steps(), session.file))
        if result is None:
            return
        self._steps, file = result
        await self._show_step()
        self._making.refresh(self._steps)
        if self._state is not None:
            self._controls.show(self._state)  # of controls that are newer than the state
        await self._result.refresh(file)
        self._making.cites(self._result.identity)

    async def _choose(self, name: str) -> None:
        self._chosen = name
        await self._show_step()

    async def _show_step(self) -> None:
        present = self._present()
        self._list.show(self._steps, present)
        self._card.show(self._steps, present)
        await self._frame.show(next((state for state in self._steps if state.step.name == present), None))

    def _present(self) -> str | None:
        """The step to show: the running one, else the chosen one, else the first open one."""
        under_way = next((state.step.name for state in self._steps if state.status == "under way"), None)
        if under_way is not None:
            self._chosen = None
            return under_way
        if self._chosen is not None:
            return self._chosen
        return next((state.step.name for state in self._steps if state.status == "open"), None)


def setup_text(session: CalibrationSession) -> str:
    """The terms in one line."""
    terms = session.terms
    tips = ", ".join(f"{tip:g}" for tip in terms.tips_mm)
    times = "" if terms.repeats == 1 else f", each {terms.repeats} times"
    return (
        f"{terms.probe}, {terms.camera}; dots every {terms.pitch_mm:g} mm, tips of {tips} mm{times}, "
        f"gauge to {100 * terms.gauge_share:g} %"
    )


LEAST_LOADINGS = 2  # of a force line: the lamps' drift hides in the slope of a single one
SIDES = 4  # of a patch: left, top, right, bottom
PROBE_TIPS_MM, PROBE_PADS_KPA = (
    (6.0, 10.0, 14.0),
    (5.0, 10.0),
)  # for the soft virtual probe, which sharper tips sink into


class TermsForm:
    """Asks for the terms and begins the session."""

    def __init__(self, instrument: Instrument, viewer: kit.Viewer, controls: kit.OperatorControls) -> None:
        self._instrument, self._viewer = instrument, viewer
        choice = instrument.camera_controller.choice
        self._virtual = choice.is_virtual
        tips, pads = (PROBE_TIPS_MM, PROBE_PADS_KPA) if self._virtual else (TIPS_MM, ())
        with ui.element("div").classes("stack"):
            self._with = kit.muted()
            with ui.element("div").classes("calibrate-terms"):
                self._name = kit.unit_field("Name", "bench", keys="text")
                self._probe = kit.select_field(list(list_probes()), value=choice.probe, label="Probe")
                self._pitch = kit.unit_field("Pitch of the dot board", "2.5", unit="mm")
                self._pitch_sd = kit.unit_field("Its standard uncertainty", "0", unit="mm")
                self._tips = kit.unit_field("Radii of the tips", _listed(tips), unit="mm", keys="text")
                self._pads = kit.unit_field("Moduli of the soft pads", _listed(pads), unit="kPa", keys="text")
                self._pads.props('hint="they measure the light on dents; without pads estimates on tissue are wide"')
                self._repeats = kit.unit_field("Loadings of each tip", "1")
                self._gauge_uncertainty = kit.unit_field("Relative uncertainty of the gauge", "0.001")
                self._seed = kit.unit_field("Seed of the virtual rig", str(choice.seed), keys="numeric")
                self._patch = kit.unit_field("Lamps seen past the probe", unit="pixels", keys="text")
                self._patch.props('hint="left, top, right, bottom; empty where they are seen nowhere" ')
            self._fields = {
                "name": self._name,
                "pitch_mm": self._pitch,
                "pitch_sd_mm": self._pitch_sd,
                "tips_mm": self._tips,
                "tip_radius_mm": self._tips,
                "pads_kpa": self._pads,
                "pad_kpa": self._pads,
                "loadings of each tip": self._repeats,
                "gauge_share": self._gauge_uncertainty,
                "seed": self._seed,
                "lamps seen past the probe": self._patch,
                "patch_px": self._patch,
            }
            with ui.element("div").classes("row"):
                self._button = kit.button("Begin", self._begin, icon="play_arrow", look="unelevated")
        controls.add(self._button)

    def show(self, state: InstrumentState) -> None:
        """Ask for what the present camera needs."""
        self._virtual = state.camera.choice.is_virtual
        self._seed.set_visibility(self._virtual)
        self._patch.set_visibility(not self._virtual)
        if self._virtual:
            self._with.text = "With the virtual rig, one click per step. It calibrates the virtual probe of this seed."
        elif state.camera.running:
            self._with.text = f"With {state.camera.name}, at its present settings."
        else:
            self._with.text = "With the chosen camera. Start it first: the session stores its settings."

    async def _begin(self) -> None:
        session = await kit.submit(self._viewer, self._fields, self._begun)
        if session is not None:
            ui.navigate.to(f"/calibrate/{quote(session.name)}")

    def _begun(self) -> CalibrationSession:
        return self._instrument.calibrating.begin(self._terms(), by=self._viewer.identity)

    def _terms(self) -> SessionSetup:
        tips = kit.typed_numbers("tips_mm", self._tips.value)
        repeats = kit.typed_integer("loadings of each tip", self._repeats.value, 1, 20)
        if len(tips) * repeats < LEAST_LOADINGS:
            raise InputError(
                f"a calibration needs at least {LEAST_LOADINGS} loadings, of two tips or of one twice; got {len(tips)} "
                f"tip and {repeats} loading of it (add a tip, or load it twice)",
                name="tips_mm",
            )
        seed = kit.typed_integer("seed", self._seed.value, 0, LARGEST_SEED)
        name = (self._name.value or "").strip()
        if not name:
            requirement = "must be given: what the calibration will be called"
            raise InputError(name="name", requirement=requirement, value="none")
        return SessionSetup(
            name=name,
            probe=self._probe.value or "",
            camera=bench_name(seed) if self._virtual else self._instrument.camera_controller.name or "camera",
            pitch_mm=kit.typed_number("pitch_mm", self._pitch.value),
            pitch_sd_mm=kit.typed_number("pitch_sd_mm", self._pitch_sd.value),
            gauge_share=kit.typed_number("gauge_share", self._gauge_uncertainty.value),
            patch_px=None if self._virtual else typed_patch(self._patch.value or ""),
            tips_mm=tips,
            repeats=repeats,
            pads_kpa=kit.typed_numbers("pads_kpa", self._pads.value),
        )


def _listed(numbers: Sequence[float]) -> str:
    return ", ".join(kit.number_text_of_field(number) for number in numbers)


def typed_patch(text: str) -> tuple[int, int, int, int] | None:
    """Left, top, right and bottom of a patch; None where nothing was typed.

    Examples
    --------
    >>> typed_patch("4, 4, 36, 36"), typed_patch(" ")
    ((4, 4, 36, 36), None)
    """
    if not text.strip():
        return None
    result = kit.typed_numbers("lamps seen past the probe", text)
    if len(result) != SIDES:
        requirement = "must be left, top, right, bottom in pixels"
        raise InputError(name="lamps seen past the probe", requirement=requirement, value=f"{text!r:.60}")
    left, top, right, bottom = (require_integer("lamps seen past the probe", side, 0, 100_000) for side in result)
    return left, top, right, bottom
