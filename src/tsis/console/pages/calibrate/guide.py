"""A session: its steps, the one that is done now, and the calibration at the end."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import run, ui

from tsis.console.live.element import LiveView
from tsis.console.pages.calibrate.kept_frame import KeptFrame
from tsis.console.pages.calibrate.making import Making
from tsis.console.pages.calibrate.result import Result
from tsis.console.pages.calibrate.step_card import StepCard
from tsis.console.pages.calibrate.step_list import StepList
from tsis.console.pages.headings import panel_title
from tsis.console.pages.operated import Operated
from tsis.model.errors import TsisError

if TYPE_CHECKING:
    from tsis.console.bench import Bench, BenchState
    from tsis.console.bench.calibrating import CalibrationSession, StepState
    from tsis.console.pages.viewer import Viewer

POLL_S = 0.3  # between two looks at the session


async def session_page(bench: Bench, viewer: Viewer, name: str) -> None:
    """Build the page of the session of that name."""
    place = ui.element("div").classes("stack")
    try:
        session: CalibrationSession | None = await run.io_bound(bench.calibrating.open, name)
    except TsisError as error:
        with place, ui.element("section").classes("panel"):
            ui.label(str(error)).classes("doubtful")
            ui.link("To the sessions", "/calibrate")
        return
    if session is None:  # the console is being ended
        return
    with place:
        _Guide(bench, viewer, session)


class _Guide:
    """The parts of a session's page, and which step is looked at."""

    def __init__(self, bench: Bench, viewer: Viewer, session: CalibrationSession) -> None:
        self._session = session
        self._operated = Operated(viewer)
        self._chosen: str | None = None
        self._steps: tuple[StepState, ...] = ()
        self._view: LiveView | None = None
        self._state: BenchState | None = None
        with ui.element("div").classes("row calibrate-head"):
            ui.link("Sessions", "/calibrate")
            panel_title(session.terms.name)
            ui.label(terms_words(session)).classes("muted")
        with ui.element("div").classes("calibrate-guide"):
            with ui.element("section").classes("panel").props('aria-label="Steps"'):
                self._list = StepList(viewer, session, self._operated, self._choose)
            with ui.element("div").classes("stack"):
                with ui.element("section").classes("panel stack").props('aria-label="Present step"'):
                    self._card = StepCard(viewer, session, self._operated)
                    self._operated.why()
                    with ui.element("div").classes("calibrate-seen"):
                        if not session.rig.by_itself:
                            with ui.element("div").classes("calibrate-live"):
                                self._view = LiveView(map_name="grey")
                        self._frame = KeptFrame(viewer, session)
                self._making = Making(bench, viewer, session, self._operated)
        self._result = Result(viewer, session)
        viewer.every(POLL_S, self._look)
        viewer.follow(self._show)

    def _show(self, state: BenchState) -> None:
        self._state = state
        self._operated.show(state)
        self._making.show(state)
        if self._view is not None:
            self._view.tell(state)

    async def _look(self) -> None:
        session = self._session
        found = await run.io_bound(lambda: (session.steps(), session.file))
        if found is None:
            return
        self._steps, file = found
        await self._show_step()
        self._making.look(self._steps)
        if self._state is not None:
            self._operated.show(self._state)  # of controls that have come since the state was told
        await self._result.look(file)
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
        """The step to show: one under way, else the one that was chosen, else the first that is open."""
        under_way = next((state.step.name for state in self._steps if state.status == "under way"), None)
        if under_way is not None:
            self._chosen = None
            return under_way
        if self._chosen is not None:
            return self._chosen
        return next((state.step.name for state in self._steps if state.status == "open"), None)


def terms_words(session: CalibrationSession) -> str:
    """The terms in one line."""
    terms = session.terms
    tips = ", ".join(f"{tip:g}" for tip in terms.tips_mm)
    times = "" if terms.repeats == 1 else f", each {terms.repeats} times"
    return (
        f"{terms.probe}, {terms.camera}; dots every {terms.pitch_mm:g} mm, tips of {tips} mm{times}, "
        f"gauge to {100 * terms.gauge_share:g} %"
    )
