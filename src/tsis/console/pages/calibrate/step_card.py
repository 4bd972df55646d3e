"""One step: what a person does, and the controls for how far it is."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.bench.jobs import DONE, FAILED
from tsis.console.pages.calibrate.questions import asked
from tsis.console.pages.calibrate.typed_loading import TypedLoading
from tsis.console.pages.classed import classed
from tsis.console.pages.headings import panel_title
from tsis.console.pages.progress_bar import ProgressBar

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Sequence

    from tsis.console.bench import JobState
    from tsis.console.bench.calibrating import CalibrationSession, StepState
    from tsis.console.pages.operated import Operated
    from tsis.console.pages.viewer import Viewer


class StepCard:
    """Shows the step that is looked at.

    Parameters
    ----------
    viewer
        Who looks.
    session
        Whose steps.
    operated
        Takes the controls.
    """

    def __init__(self, viewer: Viewer, session: CalibrationSession, operated: Operated) -> None:
        self._viewer, self._session, self._operated = viewer, session, operated
        self._shown: tuple[object, ...] = ()
        self._place = ui.element("div").classes("stack")
        self._bar = ProgressBar("Frames taken")
        self._words = ui.label().classes("muted").props("role=status")
        self._typed: TypedLoading | None = None

    def show(self, steps: Sequence[StepState], present: str | None) -> None:
        """Show the step of that name; what to do next when there is none."""
        self._progress()
        number, state = next(
            ((place, each) for place, each in enumerate(steps, 1) if each.step.name == present), (0, None)
        )
        gauge = self._session.rig.has_gauge
        now = (present, None if state is None else state.status, gauge, len(steps))
        if now != self._shown:
            self._shown = now
            self._typed = None
            self._place.clear()
            with self._place:
                self._build(state, number, len(steps))
        if self._typed is not None and state is not None:
            self._typed.show(state.forces_n)

    def _build(self, state: StepState | None, number: int, total: int) -> None:
        if state is None:
            panel_title("Every step is done or left out.")
            ui.label("Make the calibration below, or choose a step to repeat it.").classes("muted")
            return
        step = state.step
        panel_title(f"Step {number} of {total}: {step.name}")
        ui.label(f"{step.instruction}.").classes("calibrate-instruction")
        if self._session.rig.by_itself and state.status != "done":
            ui.label("This is what a person would do; the virtual bench does it by itself.").classes("muted")
        with ui.element("div").classes("row"):
            if state.status == "under way":
                self._under_way(state)
            elif state.status == "done":
                ui.label(f"Done: {state.frames} frames are kept.").classes("good")
                self._button("Repeat this step", "replay", self._repeat, step.name, outline=True)
            elif step.is_loading and not self._session.rig.has_gauge:
                self._typed = TypedLoading(self._viewer, self._session, self._operated, step.name)
            else:
                words = "Begin the loading" if step.is_loading else f"Take {step.frames} frames"
                self._button(words, "photo_camera", self._take, step.name)
            if step.optional and state.status == "open":
                self._button("Leave it out", "skip_next", self._leave_out, step.name, outline=True)

    def _under_way(self, state: StepState) -> None:
        if state.step.is_loading and not self._session.rig.by_itself:
            ui.label("Load now, slowly, and back to 0.").classes("strong")
            self._button("It is back at 0: keep it", "check", self._end_loading, state.step.name)
        self._button("End without keeping", "stop", self._end, state.step.name, outline=True)

    def _button(
        self, words: str, icon: str, act: Callable[[str], Awaitable[None]], name: str, *, outline: bool = False
    ) -> None:
        button = ui.button(words, icon=icon, on_click=lambda: act(name))
        self._operated.add(button.props("no-caps outline" if outline else "no-caps unelevated"))

    def _progress(self) -> None:
        """How far the frames of a step are, and what became of the last step."""
        job = self._session.job
        state = None if job is None else job.state()
        self._bar.show(state)
        self._words.text = "" if state is None else frames_words(state)
        classed(self._words, "doubtful", state is not None and state.status == FAILED)

    async def _take(self, name: str) -> None:
        await self._viewer.attempt(self._session.take, name, by=self._viewer.identity)

    async def _leave_out(self, name: str) -> None:
        await self._viewer.attempt(self._session.leave_out, name, by=self._viewer.identity)

    async def _end_loading(self, _: str) -> None:
        await self._viewer.attempt(self._session.end_loading, by=self._viewer.identity)

    async def _end(self, _: str) -> None:
        await self._viewer.attempt(self._session.end_step, by=self._viewer.identity)

    async def _repeat(self, name: str) -> None:
        question = f"Remove the frames of step {name!r} and take it again?"
        if await asked(question, yes="Remove and repeat", why="A calibration that was made from them is set aside."):
            await self._viewer.attempt(self._session.repeat, name, by=self._viewer.identity)


def frames_words(job: JobState) -> str:
    """How far the frames of a step are, or why they are not kept."""
    if job.running:
        return f"{job.done} of {job.total} frames" if job.total else f"{job.done} frames"
    return "" if job.status == DONE else job.sentence
