"""The calibration of a session: buttons, numbers, and figures of the residuals."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.__about__ import VALID_DAYS
from tsis.calibration import read_usable_calibration
from tsis.calibration.file import read_calibration
from tsis.console.pages.components import (
    ProgressBar,
    Redrawn,
    cards,
    drawings,
    figure,
    message_list,
    panel_title,
    set_class,
    table,
    typed_number,
    unit_field,
)
from tsis.console.services import ENDED, FAILED
from tsis.files import to_json_value
from tsis.report import Table, calibration_page, content_rows

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from tsis.calibration.file import ProbeCalibration
    from tsis.console.pages.components import OperatorControls, Viewer
    from tsis.console.services import Instrument, InstrumentState
    from tsis.console.services.calibrating import CalibrationResult, CalibrationSession, StepState
    from tsis.report import Page


class CalibrationResultPanel:
    """Shows the calibration, also one from before the program's start; ``identity`` is empty without one."""

    def __init__(self, viewer: Viewer, session: CalibrationSession) -> None:
        self._viewer, self._session = viewer, session
        self.identity = ""
        panel = ui.element("section").classes("panel stack").props('aria-label="What was measured"')
        self._panel = Redrawn(panel.set_visibility(False))

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
        page = calibration_page(result.calibration, result.findings, provenance=provenance)
        sources = await self._viewer.attempt(drawings, page)
        if sources is not None:
            self.identity = result.identity
            with self._panel.element:
                result_content(page, sources)


def result_content(page: Page, sources: Sequence[str]) -> None:
    """Cards, figures beside each other, notes, and tables beside each other."""
    cards(page.cards)
    with ui.element("div").classes("calibrate-figures"):
        ordered = sorted(zip(page.pictures, sources, strict=True), key=lambda item: item[0].wide)
        for picture, source in ordered:
            figure(picture, source)
    message_list(page.notes)
    with ui.element("div").classes("calibrate-tables"):
        for item in page.tables:
            table(item)


def calibration_content(calibration: ProbeCalibration) -> None:
    """Contents of the file of an earlier calibration."""
    ui.label("It was computed before. Compute it again from the same frames to see the residuals of its fits.").classes(
        "muted"
    )
    table(Table(title="Measured", headings=("quantity", "value", "95 % interval"), rows=content_rows(calibration)))


EXERCISE = (
    "This is an exercise with the virtual rig, whose camera no other page uses. It cannot be put in "
    "force. The virtual probe of the other pages brings a calibration of its own."
)


class MakePanel:
    """Buttons that compute the calibration, activate it and download it."""

    def __init__(
        self, instrument: Instrument, viewer: Viewer, session: CalibrationSession, controls: OperatorControls
    ) -> None:
        self._instrument, self._viewer, self._session = instrument, viewer, session
        self._identity = ""
        with ui.element("section").classes("panel stack").props('aria-label="Calibration"'):
            with ui.element("div").classes("row"):
                panel_title("Calibration")
                ui.element("div").classes("spring")
                self._days = unit_field("Good for", str(VALID_DAYS), unit="days").classes("calibrate-days")
                self._make = ui.button("Make the calibration", icon="calculate", on_click=self._begin)
                self._make.props("no-caps unelevated")
            self._bar = ProgressBar("Progress of the calibration")
            self._text = ui.label().classes("muted").props("role=status")
            with ui.element("div").classes("row") as self._commands:
                self._use = ui.button("Activate", icon="verified", on_click=self._activate)
                controls.add(self._use.props("no-caps unelevated"))
                self._active = ui.label("It is active.").classes("good")
                file = ui.button("Download the file", icon="download", on_click=self._download)
                file.props("no-caps outline")
                self._cited = ui.label().classes("muted")
                if session.rig.by_itself:
                    ui.label(EXERCISE).classes("muted")
        self._commands.set_visibility(False)

    def show(self, state: InstrumentState) -> None:
        """Say whether it is active."""
        active = bool(self._identity) and state.calibration_identity == self._identity
        self._active.set_visibility(active)
        self._use.set_visibility(not active and not self._session.rig.by_itself)

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
        set_class(self._text, "doubtful", failed)

    def cites(self, identity: str) -> None:
        """Set the identity of the calibration; empty without one."""
        self._identity = identity
        self._cited.text = f"cited as {identity[:12]}"
        self._commands.set_visibility(bool(identity))

    async def _begin(self) -> None:
        await self._viewer.attempt(lambda: self._session.make(days=typed_number("days", self._days.value)))

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
