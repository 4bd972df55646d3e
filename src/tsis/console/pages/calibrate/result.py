"""What stands behind the calibration of a session: its numbers, and figures of what the fits left."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.calibration.cited import read_usable_calibration
from tsis.calibration.file.plain_values import to_plain
from tsis.console.pages.report_parts import cards, drawings, figure, table
from tsis.console.pages.sentence_list import sentence_list
from tsis.report.calibration import calibration_page, held_rows
from tsis.report.page import Table

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from tsis.calibration.file import ProbeCalibration
    from tsis.console.bench.calibrating import CalibrationSession, MadeCalibration
    from tsis.console.pages.viewer import Viewer
    from tsis.report.page import Page


class Result:
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
        made = self._session.made
        now = file if made is None else made.identity
        if now == self._shown:
            return
        self._shown = now
        self.identity = ""
        self._place.clear()
        if made is not None:
            await self._show_made(made)
        elif file is not None:
            known = await self._viewer.attempt(read_usable_calibration, file)
            if known is not None:
                self.identity = known.identity
                with self._place:
                    held(known.known)
        self._place.set_visibility(bool(self.identity))

    async def _show_made(self, made: MadeCalibration) -> None:
        provenance = {"session": str(self._session.folder.path), "terms": to_plain(self._session.terms)}
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
        ordered = sorted(zip(page.pictures, sources, strict=True), key=lambda each: each[0].wide)
        for picture, source in ordered:
            figure(picture, source)
    sentence_list(page.notes)
    with ui.element("div").classes("calibrate-tables"):
        for each in page.tables:
            table(each)


def held(known: ProbeCalibration) -> None:
    """What the file says of a calibration that this program did not make."""
    ui.label("It was made before. Make it once more, from the same frames, to see what its fits leave.").classes(
        "muted"
    )
    table(Table(title="Measured", headings=("quantity", "value", "95 % interval"), rows=held_rows(known)))
