"""The present step of a session, a saved frame, and the calibration with the figures of its residuals."""

from __future__ import annotations

import base64
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.__about__ import VALID_DAYS
from tsis.calibration import read_usable_calibration
from tsis.calibration.file import read_calibration
from tsis.console.files import GREY, thumbnail_png
from tsis.console.pages import components as kit
from tsis.console.services import DONE, ENDED, FAILED
from tsis.files.json_values import to_json_value
from tsis.present.calibration import calibration_page, content_rows
from tsis.present.page import Table

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Sequence
    from pathlib import Path

    from tsis.calibration.file import ProbeCalibration
    from tsis.calibration.session import CalibrationStep
    from tsis.console.services import Instrument, InstrumentState, JobState
    from tsis.console.services.calibrating import CalibrationResult, CalibrationSession, StepState
    from tsis.present.page import Page


SIZE_PX = 560  # of its longer side


class SavedFrame:
    """The frame in the middle of a step, in loadings near the largest force."""

    def __init__(self, viewer: kit.Viewer, session: CalibrationSession) -> None:
        self._viewer, self._session = viewer, session
        self._shown: str | None = None
        with ui.element("figure").classes("calibrate-frame") as self._figure:
            self._image = ui.element("img")
            with ui.element("figcaption"):
                self._caption = kit.muted()
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
        kit.show_drawing(self._image, source, f"Frame of step {name}")
        self._figure.set_visibility(True)

    def _read(self, step: CalibrationStep) -> tuple[bytes, str]:
        shot = self._session.folder.middle_shot(step)
        content = thumbnail_png(shot.image.grey, full_scale=shot.image.full_scale, size=SIZE_PX, name=GREY)
        force = "" if shot.force_n is None else f", at {shot.force_n:.2f} N"
        return content, f"A frame of {step.name}{force}; its mean grey level is {shot.image.grey.mean():.1f}."


class TypedLoading:
    """The field for the next force, and the table of those so far."""

    def __init__(
        self, viewer: kit.Viewer, session: CalibrationSession, controls: kit.OperatorControls, step: str
    ) -> None:
        self._viewer, self._session, self._step = viewer, session, step
        with ui.element("div").classes("stack"):
            kit.muted("Start without contact, with the force that the gauge shows, usually 0.")
            with ui.element("div").classes("row"):
                self._force = kit.unit_field("Force that the gauge shows", unit="N").props("autofocus")
                self._force.on("keydown.enter", self._press)
                take = kit.button("Take a frame", self._press, icon="photo_camera", look="unelevated")
            self._table = kit.Redrawn(ui.element("div").classes("calibrate-forces"))
            with ui.element("div").classes("row"):
                save = kit.button(
                    "Back at 0 N: save the loading", viewer.command(session.save_presses, step), icon="check"
                )
                undo = kit.button("Remove the last", viewer.command(session.unpress, step), icon="undo")
        controls.add(self._force, take, save, undo)

    def show(self, forces_n: Sequence[float]) -> None:
        """Show the forces so far."""
        if not self._table.changes_to(forces_n):
            return
        with self._table.element:
            kit.muted(f"{len(forces_n)} frames" if forces_n else "No frame yet.")
            for force in forces_n:
                ui.label(f"{force:g} N").classes("chip")

    async def _press(self) -> None:
        text = str(self._force.value or "")

        def pressed() -> int:
            force = kit.typed_number("force", text.replace(",", "."))
            return self._session.press(self._step, force, by=self._viewer.identity)

        if await kit.submit(self._viewer, {"force": self._force}, pressed) is not None:
            self._force.set_value("")


class StepCard:
    """Shows the present step."""

    def __init__(self, viewer: kit.Viewer, session: CalibrationSession, controls: kit.OperatorControls) -> None:
        self._viewer, self._session, self._controls = viewer, session, controls
        self._container = kit.Redrawn(ui.element("div").classes("stack"))
        self._bar = kit.ProgressBar("Frames taken")
        self._text = kit.status()
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
            kit.panel_title("Every step is done or skipped.")
            kit.muted("Make the calibration below, or choose a step to repeat it.")
            return
        step, session, command = state.step, self._session, self._viewer.command
        kit.panel_title(f"Step {number} of {total}: {step.name}")
        ui.label(f"{step.instruction}.").classes("calibrate-instruction")
        if session.rig.by_itself and state.status != "done":
            kit.muted("Instructions for an operator; the virtual rig does this step.")
        with ui.element("div").classes("row"):
            if state.status == "under way":
                self._under_way(state)
            elif state.status == "done":
                ui.label(f"Done: {state.frames} frames are saved.").classes("good")
                self._button("Repeat this step", "replay", lambda: self._repeat(step.name), look="outline")
            elif step.is_loading and not session.rig.has_gauge:
                self._typed = TypedLoading(self._viewer, session, self._controls, step.name)
            else:
                text = "Begin the loading" if step.is_loading else f"Take {step.frames} frames"
                self._button(text, "photo_camera", command(session.take, step.name))
            if step.optional and state.status == "open":
                self._button("Skip this step", "skip_next", command(session.leave_out, step.name), look="outline")

    def _under_way(self, state: StepState) -> None:
        session, command = self._session, self._viewer.command
        if state.step.is_loading and not session.rig.by_itself:
            ui.label("Load now, slowly, and back to 0.").classes("strong")
            self._button("Back at 0 N: save the loading", "check", command(session.end_loading))
        self._button("Cancel", "stop", command(session.end_step), look="outline")

    def _button(self, text: str, icon: str, act: Callable[[], Awaitable[object]], look: str = "unelevated") -> None:
        self._controls.add(kit.button(text, act, icon=icon, look=look))

    def _progress(self) -> None:
        """How far the frames of a step are, and what became of the last step."""
        job = self._session.job
        state = None if job is None else job.state()
        self._bar.show(state)
        self._text.text = "" if state is None else frames_text(state)
        kit.set_class(self._text, "doubtful", state is not None and state.status == FAILED)

    async def _repeat(self, name: str) -> None:
        question = f"Remove the frames of step {name!r} and take it again?"
        if await kit.is_confirmed(
            question, yes="Remove and repeat", why="A calibration computed from them is set aside."
        ):
            await self._viewer.command(self._session.repeat, name)()


def frames_text(job: JobState) -> str:
    """Progress of a step's frames, or why they are not saved."""
    if job.running:
        counted = f"{job.done} of {job.total} frames"
        return counted if job.total else f"{job.done} frames"
    return "" if job.status == DONE else job.sentence


class CalibrationResultPanel:
    """Shows the calibration, also one from before the program's start; ``identity`` is empty without one."""

    def __init__(self, viewer: kit.Viewer, session: CalibrationSession) -> None:
        self._viewer, self._session = viewer, session
        self.identity = ""
        panel = ui.element("section").classes("panel stack").props('aria-label="What was measured"')
        self._panel = kit.Redrawn(panel.set_visibility(False))

    async def refresh(self, file: Path | None) -> None:
        """Show changes; ``file`` is the calibration's, None before it exists."""
        result = self._session.result
        if not self._panel.changes_to(file if result is None else result.identity):
            return
        self.identity = ""
        if result is not None:
            await self._show_result(result)
        elif file is not None:
            given = await self._viewer.attempt(read_usable_calibration, file)
            if given is not None:
                self.identity = given.identity
                with self._panel.element:
                    calibration_content(given.calibration)
        self._panel.element.set_visibility(bool(self.identity))

    async def _show_result(self, result: CalibrationResult) -> None:
        provenance = {"session": str(self._session.folder.path), "terms": to_json_value(self._session.terms)}
        page = calibration_page(result.measured, result.findings, provenance=provenance)
        sources = await self._viewer.attempt(kit.drawings, page)
        if sources is not None:
            self.identity = result.identity
            with self._panel.element:
                result_content(page, sources)


def result_content(page: Page, sources: Sequence[str]) -> None:
    """Cards, figures beside each other, notes, and tables beside each other."""
    kit.cards(page.cards)
    with ui.element("div").classes("calibrate-figures"):
        ordered = sorted(zip(page.pictures, sources, strict=True), key=lambda item: item[0].wide)
        for picture, source in ordered:
            kit.figure(picture, source)
    kit.message_list(page.notes)
    with ui.element("div").classes("calibrate-tables"):
        for item in page.tables:
            kit.table(item)


def calibration_content(calibration: ProbeCalibration) -> None:
    """Contents of the file of an earlier calibration."""
    kit.muted("It was computed before. Compute it again from the same frames to see the residuals of its fits.")
    kit.table(Table(title="Measured", columns=("quantity", "value", "95 % interval"), values=content_rows(calibration)))


class MakePanel:
    """Buttons that compute the calibration, activate it and download it."""

    def __init__(
        self, instrument: Instrument, viewer: kit.Viewer, session: CalibrationSession, controls: kit.OperatorControls
    ) -> None:
        self._instrument, self._viewer, self._session = instrument, viewer, session
        self._identity = ""
        with ui.element("section").classes("panel stack").props('aria-label="Calibration"'):
            with kit.title_row("Calibration"):
                self._days = kit.unit_field("Good for", str(VALID_DAYS), unit="days").classes("calibrate-days")
                self._make = kit.button("Make the calibration", self._begin, icon="calculate", look="unelevated")
            self._bar = kit.ProgressBar("Progress of the calibration")
            self._text = kit.status()
            with ui.element("div").classes("row") as self._commands:
                self._use = controls.add(kit.button("Activate", self._activate, icon="verified", look="unelevated"))
                self._active = ui.label("It is active.").classes("good")
                kit.button("Download the file", self._download, icon="download")
                self._cited = kit.muted()
        self._commands.set_visibility(False)

    def show(self, state: InstrumentState) -> None:
        """Say whether it is active."""
        active = bool(self._identity) and state.calibration_identity == self._identity
        self._active.set_visibility(active)
        self._use.set_visibility(not active)

    def refresh(self, steps: Sequence[StepState]) -> None:
        """Show what is missing, or how far it is."""
        lacking = [state.step.name for state in steps if state.status != "done" and not state.step.optional]
        self._make.set_enabled(not lacking and not self._session.busy)
        self._days.set_visibility(not lacking and self._session.terms.began is not None)
        job = None if self._session.making is None else self._session.making.state()
        self._bar.show(job)
        failed = job is not None and job.status in (FAILED, ENDED) and not lacking
        text = f"It needs these steps: {', '.join(lacking)}." if lacking else ""
        if job is not None and job.running:
            text = "Reading the frames and fitting."
        elif job is not None and failed:
            text = job.sentence
        self._text.text = text
        self._text.set_visibility(bool(text))
        kit.set_class(self._text, "doubtful", failed)

    def cites(self, identity: str) -> None:
        """Set the identity of the calibration; empty without one."""
        self._identity = identity
        self._cited.text = f"cited as {identity[:12]}"
        self._commands.set_visibility(bool(identity))

    async def _begin(self) -> None:
        fields = {"days": self._days}
        await kit.submit(
            self._viewer, fields, lambda: self._session.make(days=kit.typed_number("days", self._days.value))
        )

    async def _activate(self) -> None:
        def activated() -> str:
            usable = read_usable_calibration(self._file())
            self._instrument.use_calibration(usable, by=self._viewer.identity)
            return usable.calibration.name

        name = await self._viewer.attempt(activated)
        if name is not None:
            self._viewer.notify(f"Calibration {name} is active.")

    async def _download(self) -> None:
        def content() -> bytes:
            read_calibration(self._file())  # refuses one that was changed
            return self._file().read_bytes()

        document = await self._viewer.attempt(content)
        if document is not None:
            ui.download.content(document, f"calibration-{self._session.name}.json", "application/json")

    def _file(self) -> Path:
        file = self._session.file
        assert file is not None  # the buttons are there with it
        return file
