"""What stands behind the calibration of a session: its numbers, and figures of what the fits left."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.calibration import read_usable_calibration
from tsis.calibration.file import read_calibration
from tsis.calibration.session import DAYS
from tsis.console.pages.components import (
    ProgressBar,
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
    """Shows what was made, or what was made before the program began.

    Parameters
    ----------
    viewer
        Who looks.
    session
        Whose calibration.

    Attributes
    ----------
    identity
        Of what is shown; empty while nothing was made.
    """

    def __init__(self, viewer: Viewer, session: CalibrationSession) -> None:
        self._viewer, self._session = viewer, session
        self._shown: object = None
        self.identity = ""
        self._place = ui.element("section").classes("panel stack").props('aria-label="What was measured"')
        self._place.set_visibility(False)

    async def look(self, file: Path | None) -> None:
        """Show what is new; ``file`` is the calibration's, None before it was made."""
        created = self._session.made
        now = file if created is None else created.identity
        if now == self._shown:
            return
        self._shown = now
        self.identity = ""
        self._place.clear()
        if created is not None:
            await self._show_made(created)
        elif file is not None:
            given = await self._viewer.attempt(read_usable_calibration, file)
            if given is not None:
                self.identity = given.identity
                with self._place:
                    calibration_content(given.calibration)
        self._place.set_visibility(bool(self.identity))

    async def _show_made(self, made: CalibrationResult) -> None:
        provenance = {"session": str(self._session.folder.path), "terms": to_json_value(self._session.terms)}
        page = calibration_page(made.known, made.findings, provenance=provenance)
        sources = await self._viewer.attempt(drawings, page)
        if sources is not None:
            self.identity = made.identity
            with self._place:
                whole(page, sources)


def whole(page: Page, sources: Sequence[str]) -> None:
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


def calibration_content(known: ProbeCalibration) -> None:
    """What the file says of a calibration that this program did not make."""
    ui.label("It was made before. Make it once more, from the same frames, to see what its fits leave.").classes(
        "muted"
    )
    table(Table(title="Measured", headings=("quantity", "value", "95 % interval"), rows=content_rows(known)))


EXERCISE = (
    "This is an exercise: it is of the virtual bench, whose camera no other page looks through, and cannot be put in "
    "force. The virtual probe of the other pages brings a calibration of its own."
)


class Making:
    """Buttons that make the calibration, put it in force and download it.

    Parameters
    ----------
    bench
        Where it is put in force.
    viewer
        Who looks.
    session
        Whose frames.
    operated
        Takes the button that puts it in force.
    """

    def __init__(
        self, bench: Instrument, viewer: Viewer, session: CalibrationSession, operated: OperatorControls
    ) -> None:
        self._bench, self._viewer, self._session = bench, viewer, session
        self._identity = ""
        with ui.element("section").classes("panel stack").props('aria-label="Calibration"'):
            with ui.element("div").classes("row"):
                panel_title("Calibration")
                ui.element("div").classes("spring")
                self._days = unit_field("Good for", str(DAYS), unit="days").classes("calibrate-days")
                self._make = ui.button("Make the calibration", icon="calculate", on_click=self._begin)
                self._make.props("no-caps unelevated")
            self._bar = ProgressBar("Progress of the calibration")
            self._words = ui.label().classes("muted").props("role=status")
            with ui.element("div").classes("row") as self._acts:
                self._force = ui.button("Put in force", icon="verified", on_click=self._put_in_force)
                operated.add(self._force.props("no-caps unelevated"))
                self._in_force = ui.label("It is in force.").classes("good")
                file = ui.button("Download the file", icon="download", on_click=self._download)
                file.props("no-caps outline")
                self._cited = ui.label().classes("muted")
                if session.rig.by_itself:
                    ui.label(EXERCISE).classes("muted")
        self._acts.set_visibility(False)

    def show(self, state: InstrumentState) -> None:
        """Say whether it is in force."""
        here = bool(self._identity) and state.calibration_identity == self._identity
        self._in_force.set_visibility(here)
        self._force.set_visibility(not here and not self._session.rig.by_itself)

    def look(self, steps: Sequence[StepState]) -> None:
        """Show what is missing, or how far it is."""
        lacking = [state.step.name for state in steps if state.status != "done" and not state.step.optional]
        self._make.set_enabled(not lacking and not self._session.busy)
        self._days.set_visibility(not lacking and self._session.terms.began is not None)
        job = None if self._session.making is None else self._session.making.state()
        self._bar.show(job)
        failed = job is not None and job.status in (FAILED, ENDED) and not lacking
        text = f"It needs these steps: {', '.join(lacking)}." if lacking else ""
        if job is not None and job.running:
            text = "The frames are read and the fits made."
        elif job is not None and failed:
            text = job.sentence
        self._words.text = text
        self._words.set_visibility(bool(text))
        set_class(self._words, "doubtful", failed)

    def cites(self, identity: str) -> None:
        """Take the identity of the calibration that was made; empty without one."""
        self._identity = identity
        self._cited.text = f"cited as {identity[:12]}"
        self._acts.set_visibility(bool(identity))

    async def _begin(self) -> None:
        await self._viewer.attempt(self._begun)

    def _begun(self) -> object:
        return self._session.make(days=typed_number("days", str(self._days.value or "")))

    async def _put_in_force(self) -> None:
        name = await self._viewer.attempt(self._used)
        if name is not None:
            self._viewer.tell(f"Calibration {name} is in force.")

    def _used(self) -> str:
        file = self._session.file
        assert file is not None  # the button is there with it
        usable_calibration = read_usable_calibration(file)
        self._bench.use_calibration(usable_calibration, by=self._viewer.identity)
        return usable_calibration.calibration.name

    async def _download(self) -> None:
        content = await self._viewer.attempt(self._content)
        if content is not None:
            ui.download.content(content, f"calibration-{self._session.name}.json", "application/json")

    def _content(self) -> bytes:
        file = self._session.file
        assert file is not None  # the button is there with it
        read_calibration(file)  # refuses one that was changed
        return file.read_bytes()
