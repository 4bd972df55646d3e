"""The pages of calibration sessions: their list, and one session with its steps."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING
from urllib.parse import quote

from nicegui import run, ui

from tsis.console.live import LiveView
from tsis.console.pages.calibrate._setup_form import TermsForm
from tsis.console.pages.calibrate._steps import CalibrationResultPanel, MakePanel, SavedFrame, StepCard
from tsis.console.pages.components import OperatorControls, Redrawn, panel_title
from tsis.errors import TsisError

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Sequence

    from tsis.console.pages.components import Viewer
    from tsis.console.services import Instrument, InstrumentState
    from tsis.console.services.calibrating import CalibrationSession, SessionSummary, StepState


LIST_EVERY_S, SESSION_EVERY_S = 2.0, 0.3  # between two readings


def calibrate_page(instrument: Instrument, viewer: Viewer) -> None:
    """Build the page."""
    controls = OperatorControls(viewer)
    with ui.element("div").classes("split calibrate-choosing"):
        with ui.element("section").classes("panel"):
            panel_title("Sessions")
            listed = Redrawn(ui.element("div").classes("stack"))
        with ui.element("section").classes("panel"):
            panel_title("Begin a calibration")
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
        ui.label(
            "None yet. A calibration converts grey levels to newtons and pixels to millimetres; begin one, and "
            "it leads through its steps. It can be interrupted at any time and goes on where it was left."
        ).classes("muted")
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
                ui.label(f"{item.probe}, {item.camera}").classes("muted")
                ui.element("div").classes("spring")
                if item.made:
                    ui.label("calibration made").classes("good")
                else:
                    ui.label(f"{item.done} of {item.total} steps").classes("muted")


ICONS = {"open": "radio_button_unchecked", "under way": "hourglass_top", "done": "check_circle", "left out": "remove"}


class StepList:
    """Choice of a step, and a button that takes all steps of the virtual rig."""

    def __init__(
        self,
        viewer: Viewer,
        session: CalibrationSession,
        controls: OperatorControls,
        choose: Callable[[str], Awaitable[None]],
    ) -> None:
        self._choose = choose
        self._title = panel_title("Steps")
        self._list = Redrawn(ui.element("ol").classes("calibrate-steps"))
        self._all = ui.button(
            "Take all open steps", icon="fast_forward", on_click=viewer.command(session.take_all)
        ).classes("calibrate-all")
        self._automatic = session.rig.by_itself
        self._all.set_visibility(self._automatic)
        controls.add(self._all.props("no-caps outline"))

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
            button = ui.button(on_click=partial(self._choose, name)).props("flat no-caps align=left")
            button.classes("calibrate-step here" if here else "calibrate-step")
            button.props["aria-label"] = f"Step {name}: {status_text(state)}"
            if here:
                button.props('aria-current="step"')
            with button:
                ui.icon(ICONS[state.status]).classes(state.status.replace(" ", "-"))
                ui.label(name).classes("calibrate-step-name")
                ui.label(status_text(state)).classes("muted")


def status_text(state: StepState) -> str:
    """How far a step is."""
    if state.status == "done":
        return f"{state.frames} frames"
    if state.forces_n:
        return f"{len(state.forces_n)} forces, not kept"
    if state.status == "open" and state.step.optional:
        return "open, may be left out"
    return state.status


async def session_page(instrument: Instrument, viewer: Viewer, name: str) -> None:
    """Build the page of the session of that name."""
    position = ui.element("div").classes("stack")
    try:
        session: CalibrationSession | None = await run.io_bound(instrument.calibrating.open, name)
    except TsisError as error:
        with position, ui.element("section").classes("panel"):
            ui.label(str(error)).classes("doubtful")
            ui.link("To the sessions", "/calibrate")
        return
    if session is None:  # the console is being ended
        return
    with position:
        _Guide(instrument, viewer, session)


class _Guide:
    """The parts of a session's page, and the present step."""

    def __init__(self, instrument: Instrument, viewer: Viewer, session: CalibrationSession) -> None:
        self._session = session
        self._controls = OperatorControls(viewer)
        self._chosen: str | None = None
        self._steps: tuple[StepState, ...] = ()
        self._view: LiveView | None = None
        self._state: InstrumentState | None = None
        with ui.element("div").classes("row calibrate-head"):
            ui.link("Sessions", "/calibrate")
            panel_title(session.terms.name)
            ui.label(setup_text(session)).classes("muted")
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
