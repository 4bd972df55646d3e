"""How the parts of the measurement lie on the page, and who tells them of changes."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from nicegui import run, ui

from tsis.console.live.element import LiveView
from tsis.console.pages.calibration_seen import CalibrationSeen
from tsis.console.pages.classed import classed
from tsis.console.pages.estimate_job import estimate_job
from tsis.console.pages.hardness.estimating import Estimating
from tsis.console.pages.hardness.flow import PRESSES, Kept, kept, lacking, next_words
from tsis.console.pages.hardness.object_part import ObjectPart
from tsis.console.pages.hardness.press_part import PressPart
from tsis.console.pages.hardness.result import Result
from tsis.console.pages.operated import Operated
from tsis.model.errors import TsisError

if TYPE_CHECKING:
    from tsis.console.bench import Bench, BenchState
    from tsis.console.pages.viewer import Viewer

LOOK_S = 0.5  # between two looks into the store


def page(bench: Bench, viewer: Viewer) -> None:
    """Build the page."""
    _Measurement(bench, viewer)


class _Measurement:
    """The parts of the page, and what they show."""

    def __init__(self, bench: Bench, viewer: Viewer) -> None:
        self._bench, self._viewer, self._calibration = bench, viewer, CalibrationSeen(bench)
        self._state: BenchState | None = None
        self._found = Kept(number=0)
        self._mark: object = None
        self._trouble = ""
        self._operated = Operated(viewer)
        with ui.element("div").classes("split hardness"):
            with ui.element("section").classes("panel").props('aria-label="Live image"'):
                self._live = LiveView()
                self._sight = ui.label().classes("muted")
            with ui.element("section").classes("stack").props('aria-label="Steps"'):
                with ui.element("div").classes("panel hardness-next"):
                    self._next = ui.label().classes("strong").props("role=status")
                    self._operated.why()
                self._object = ObjectPart(bench, viewer, self._operated)
                self._presses = PressPart(bench, viewer, self._operated)
                self._estimating = Estimating(bench, viewer, self._object.radius, self._presses.ball_radius)
        self._result = Result(viewer)
        viewer.every(LOOK_S, self._look)
        viewer.follow(self._show)

    def _show(self, state: BenchState) -> None:
        self._state = state
        self._live.tell(state)
        sight = state.sight
        self._sight.text = "" if sight is None else "; ".join(flag.advice for flag in sight.flags)
        classed(self._sight, "doubtful", sight is not None and bool(sight.flags))
        self._operated.show(state)
        self._presses.show(state)
        self._tell(state)

    async def _look(self) -> None:
        """Read what is kept when it may have changed: here, in another tab or by a script."""
        state = self._state
        if state is None:
            return
        self._operated.show(state)  # whoever was away for a moment may hold the camera again
        touches = not state.camera.choice.is_virtual or state.camera.choice.is_sphere
        try:
            now = (await self._viewer.entries(), state.target, touches)
            if now == self._mark:
                return
            found = await run.io_bound(kept, self._bench.store, state.target)
        except TsisError as error:
            self._mark, self._trouble = None, str(error)
            self._tell(self._state or state)
            return
        if found is None:  # the console is being ended
            return
        if not touches and found.estimate is None:  # presses on the virtual tissue tell no hardness
            found = replace(found, presses=())
        self._mark, self._found, self._trouble = now, found, ""
        self._tell(self._state or state)
        await self._result.show(found)

    def _tell(self, state: BenchState) -> None:
        """Say what is to be done next; while a target was not yet read, that it is being read."""
        read = self._found.number == state.target
        found = self._found if read else Kept(number=state.target)
        self._object.show(state, found)
        self._presses.kept(found)
        known = self._calibration.of(state)
        missing = lacking(
            state,
            scaled=known is not None and known.known.scale is not None,
            responds=known is not None and known.known.response is not None,
        )
        job = estimate_job(state)
        running = job is not None and job.running
        words = next_words(found, missing, estimating=running) if read else f"Target {state.target} is being read."
        self._next.text = self._trouble or words
        self._presses.allow(not missing)
        self._estimating.show(job, enough=len(found.on_object) >= 1, two=len(found.on_object) >= PRESSES)
