"""The page Hardness: object, presses, estimate and result."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from nicegui import run, ui

from tsis.console.live import LiveView
from tsis.console.pages.components import (
    CalibrationMemory,
    OperatorControls,
    ProgressBar,
    estimate_job,
    panel_title,
    set_class,
    with_field_labels,
)
from tsis.console.pages.hardness._flow import (
    BALL,
    HARDNESS,
    PRESSES,
    SavedPresses,
    missing_text,
    next_step_text,
    saved_presses,
)
from tsis.console.pages.hardness._parts import ObjectPart, PressPart
from tsis.console.pages.hardness._result import HardnessPanel
from tsis.console.services import FAILED
from tsis.errors import TsisError

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.console.pages.components import Viewer
    from tsis.console.services import Instrument, InstrumentState, Job, JobState


LABELS = {
    "radius_mm": "radius of the object",
    "radius_sd_mm": "its standard deviation",
    "reference_radius_mm": "radius of the ball",
}


class Estimating:
    """Begins the estimate, with the typed radii."""

    def __init__(
        self,
        instrument: Instrument,
        viewer: Viewer,
        radius: Callable[[], dict[str, float]],
        ball_radius: Callable[[], float],
    ) -> None:
        self._instrument, self._viewer, self._radius, self._ball_radius = instrument, viewer, radius, ball_radius
        with ui.element("div").classes("panel stack tight"):
            with ui.element("div").classes("row"):
                panel_title("3  Estimate")
                ui.element("div").classes("spring")
                self._button = ui.button("Estimate", icon="analytics", on_click=self._begin)
                self._button.props("no-caps unelevated")
            self._bar = ProgressBar("Progress of the estimate")
            self._message = ui.label().classes("muted").props("role=status")

    def show(self, job: JobState | None, *, enough: bool, two: bool) -> None:
        """Show whether it can begin, and how far it is."""
        running = job is not None and job.running
        failed = job is not None and job.status == FAILED
        self._button.set_enabled(enough and not running)
        self._bar.show(job)
        if running:
            text = "The contact of a probe that was never used before is solved once, which takes some minutes."
        elif job is not None and failed:
            text = with_field_labels(job.sentence, LABELS)
        else:
            text = "" if two or not enough else "One press is nearly as precise, but nothing tests it."
        self._message.text = text
        set_class(self._message, "doubtful", failed)

    async def _begin(self) -> None:
        def begin() -> Job:
            number = self._instrument.state().target
            presses = saved_presses(self._instrument.store, number).presses
            options = self._radius()
            if any(press.role == BALL for press in presses):
                options["reference_radius_mm"] = self._ball_radius()
            identities = [press.id for press in presses] or None
            return self._instrument.estimate(number, kind=HARDNESS, presses=identities, options=options)

        await self._viewer.attempt(begin)


EVERY_S = 0.5  # between two readings of the store


class HardnessPage:
    """The parts of the page, and what they show."""

    def __init__(self, instrument: Instrument, viewer: Viewer) -> None:
        self._instrument, self._viewer, self._calibration = instrument, viewer, CalibrationMemory(instrument)
        self._state: InstrumentState | None = None
        self._results = SavedPresses(number=0)
        self._mark: object = None
        self._trouble = ""
        self._controls = OperatorControls(viewer)
        with ui.element("div").classes("split hardness"):
            with ui.element("section").classes("panel").props('aria-label="Live image"'):
                self._live = LiveView()
                self._analysis = ui.label().classes("muted")
            with ui.element("section").classes("stack").props('aria-label="Steps"'):
                with ui.element("div").classes("panel hardness-next"):
                    self._next = ui.label().classes("strong").props("role=status")
                    self._controls.why()
                self._object = ObjectPart(instrument, viewer, self._controls)
                self._presses = PressPart(instrument, viewer, self._controls)
                self._estimating = Estimating(instrument, viewer, self._object.radius, self._presses.ball_radius)
        self._result = HardnessPanel(viewer)
        viewer.every(EVERY_S, self._refresh)
        viewer.follow(self._show)

    def _show(self, state: InstrumentState) -> None:
        self._state = state
        self._live.update_state(state)
        analysis = state.frame_analysis
        self._analysis.text = "" if analysis is None else "; ".join(flag.advice for flag in analysis.flags)
        set_class(self._analysis, "doubtful", analysis is not None and bool(analysis.flags))
        self._controls.show(state)
        self._presses.show(state)
        self._notify(state)

    async def _refresh(self) -> None:
        """Read the store after a possible change, also by another tab or a script."""
        state = self._state
        if state is None:
            return
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
        if result is None:  # the console is being ended
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
        self._presses.show_presses(result)
        given = self._calibration.of(state)
        missing = missing_text(
            state,
            scaled=given is not None and given.calibration.scale is not None,
            responds=given is not None and given.calibration.response is not None,
        )
        job = estimate_job(state)
        running = job is not None and job.running
        text = next_step_text(result, missing, estimating=running) if read else f"Target {state.target} is being read."
        self._next.text = self._trouble or text
        self._presses.allow(not missing)
        self._estimating.show(job, enough=len(result.on_object) >= 1, two=len(result.on_object) >= PRESSES)
