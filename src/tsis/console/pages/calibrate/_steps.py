"""The present step of a session: instruction, commands, typed forces, and a saved frame."""

from __future__ import annotations

import base64
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.files import GREY, thumbnail_png
from tsis.console.pages.components import (
    FORCE,
    ProgressBar,
    Redrawn,
    field_messages,
    panel_title,
    set_class,
    show_drawing,
    typed_number,
    unit_field,
)
from tsis.console.services import DONE, FAILED

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Sequence

    from tsis.calibration.session import CalibrationStep
    from tsis.console.pages.components import OperatorControls, Viewer
    from tsis.console.services import JobState
    from tsis.console.services.calibrating import CalibrationSession, StepState


async def is_confirmed(question: str, *, yes: str, why: str) -> bool:
    """Ask for confirmation; False without a response."""
    with ui.dialog() as dialog, ui.card(), ui.element("div").classes("question"):
        ui.label(question).classes("strong")
        ui.label(why).classes("muted")
        with ui.element("div").classes("row"):
            ui.element("div").classes("spring")
            ui.button("Cancel", on_click=lambda: dialog.submit(False)).props("flat no-caps")
            ui.button(yes, on_click=lambda: dialog.submit(True)).props("unelevated no-caps")
    response = bool(await dialog)
    dialog.delete()
    return response


SIZE_PX = 560  # of its longer side


class SavedFrame:
    """The frame in the middle of a step, in loadings near the largest force."""

    def __init__(self, viewer: Viewer, session: CalibrationSession) -> None:
        self._viewer, self._session = viewer, session
        self._shown: str | None = None
        with ui.element("figure").classes("calibrate-frame") as self._figure:
            self._image = ui.element("img")
            with ui.element("figcaption"):
                self._caption = ui.label().classes("muted")
        self._figure.set_visibility(False)

    async def show(self, state: StepState | None) -> None:
        """Show a frame of the step if it is done."""
        name = None if state is None or state.status != "done" else state.step.name
        if name == self._shown:
            return
        self._shown = name
        self._figure.set_visibility(False)
        if state is None or name is None:
            return
        result = await self._viewer.attempt(self._read, state.step)
        if result is None or self._shown != name:
            return
        content, caption = result
        self._caption.text = caption
        source = f"data:image/png;base64,{base64.b64encode(content).decode()}"
        show_drawing(self._image, source, f"Frame of step {name}")
        self._figure.set_visibility(True)

    def _read(self, step: CalibrationStep) -> tuple[bytes, str]:
        shot = self._session.folder.middle_shot(step)
        content = thumbnail_png(shot.image.grey, full_scale=shot.image.full_scale, size=SIZE_PX, name=GREY)
        force = "" if shot.force_n is None else f", at {shot.force_n:.2f} N"
        return content, f"A frame of {step.name}{force}; its mean grey level is {shot.image.grey.mean():.1f}."


class TypedLoading:
    """The field for the next force, and the table of those so far."""

    def __init__(self, viewer: Viewer, session: CalibrationSession, controls: OperatorControls, step: str) -> None:
        self._viewer, self._session, self._step = viewer, session, step
        with ui.element("div").classes("stack"):
            ui.label("Begin untouched with the force that the gauge shows then, usually 0.").classes("muted")
            with ui.element("div").classes("row"):
                self._force = unit_field("Force that the gauge shows", unit="N").props("autofocus")
                self._force.on("keydown.enter", self._press)
                take = ui.button("Take a frame", icon="photo_camera", on_click=self._press).props("no-caps unelevated")
            self._table = Redrawn(ui.element("div").classes("calibrate-forces"))
            with ui.element("div").classes("row"):
                save = ui.button(
                    "It is back at 0: save it", icon="check", on_click=viewer.command(session.save_presses, step)
                )
                undo = ui.button("Remove the last", icon="undo", on_click=viewer.command(session.unpress, step))
        controls.add(self._force, take, save.props("no-caps outline"), undo.props("no-caps outline"))

    def show(self, forces_n: Sequence[float]) -> None:
        """Show the forces so far."""
        if not self._table.changes_to(forces_n):
            return
        with self._table.element:
            ui.label(f"{len(forces_n)} frames" if forces_n else "No frame yet.").classes("muted")
            for force in forces_n:
                ui.label(f"{force:g} N").classes("chip")

    async def _press(self) -> None:
        text = str(self._force.value or "")

        def pressed() -> int:
            force = typed_number("force", text.replace(",", "."))
            with field_messages(FORCE):
                return self._session.press(self._step, force, by=self._viewer.identity)

        if await self._viewer.attempt(pressed) is not None:
            self._force.set_value("")


class StepCard:
    """Shows the present step."""

    def __init__(self, viewer: Viewer, session: CalibrationSession, controls: OperatorControls) -> None:
        self._viewer, self._session, self._controls = viewer, session, controls
        self._container = Redrawn(ui.element("div").classes("stack"))
        self._bar = ProgressBar("Frames taken")
        self._text = ui.label().classes("muted").props("role=status")
        self._typed: TypedLoading | None = None

    def show(self, steps: Sequence[StepState], present: str | None) -> None:
        """Show the step of that name; what to do next when there is none."""
        self._progress()
        number, state = next(
            ((index, step) for index, step in enumerate(steps, 1) if step.step.name == present), (0, None)
        )
        gauge = self._session.rig.has_gauge
        now = (present, None if state is None else state.status, gauge, len(steps))
        if self._container.changes_to(now):
            self._typed = None
            with self._container.element:
                self._build(state, number, len(steps))
        if self._typed is not None and state is not None:
            self._typed.show(state.forces_n)

    def _build(self, state: StepState | None, number: int, total: int) -> None:
        if state is None:
            panel_title("Every step is done or left out.")
            ui.label("Make the calibration below, or choose a step to repeat it.").classes("muted")
            return
        step, session, command = state.step, self._session, self._viewer.command
        panel_title(f"Step {number} of {total}: {step.name}")
        ui.label(f"{step.instruction}.").classes("calibrate-instruction")
        if session.rig.by_itself and state.status != "done":
            ui.label("Instructions for an operator; the virtual rig does this step.").classes("muted")
        with ui.element("div").classes("row"):
            if state.status == "under way":
                self._under_way(state)
            elif state.status == "done":
                ui.label(f"Done: {state.frames} frames are saved.").classes("good")
                self._button("Repeat this step", "replay", lambda: self._repeat(step.name), outline=True)
            elif step.is_loading and not session.rig.has_gauge:
                self._typed = TypedLoading(self._viewer, session, self._controls, step.name)
            else:
                text = "Begin the loading" if step.is_loading else f"Take {step.frames} frames"
                self._button(text, "photo_camera", command(session.take, step.name))
            if step.optional and state.status == "open":
                self._button("Leave it out", "skip_next", command(session.leave_out, step.name), outline=True)

    def _under_way(self, state: StepState) -> None:
        session, command = self._session, self._viewer.command
        if state.step.is_loading and not session.rig.by_itself:
            ui.label("Load now, slowly, and back to 0.").classes("strong")
            self._button("It is back at 0: save it", "check", command(session.end_loading))
        self._button("End without keeping", "stop", command(session.end_step), outline=True)

    def _button(self, text: str, icon: str, act: Callable[[], Awaitable[object]], *, outline: bool = False) -> None:
        button = ui.button(text, icon=icon, on_click=act)
        self._controls.add(button.props("no-caps outline" if outline else "no-caps unelevated"))

    def _progress(self) -> None:
        """How far the frames of a step are, and what became of the last step."""
        job = self._session.job
        state = None if job is None else job.state()
        self._bar.show(state)
        self._text.text = "" if state is None else frames_text(state)
        set_class(self._text, "doubtful", state is not None and state.status == FAILED)

    async def _repeat(self, name: str) -> None:
        question = f"Remove the frames of step {name!r} and take it again?"
        if await is_confirmed(question, yes="Remove and repeat", why="A calibration computed from them is set aside."):
            await self._viewer.command(self._session.repeat, name)()


def frames_text(job: JobState) -> str:
    """Progress of a step's frames, or why they are not saved."""
    if job.running:
        return f"{job.done} of {job.total} frames" if job.total else f"{job.done} frames"
    return "" if job.status == DONE else job.sentence
