"""A loading without a gauge at the computer: the person types each force, and a frame is taken at it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.field_words import FORCE, field_words
from tsis.console.pages.number_field import typed_number, unit_field

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.console.bench.calibrating import CalibrationSession
    from tsis.console.pages.operated import Operated
    from tsis.console.pages.viewer import Viewer


class TypedLoading:
    """The field for the next force, and the table of those so far.

    Parameters
    ----------
    viewer
        Who types.
    session, step
        Which loading.
    operated
        Takes the controls.
    """

    def __init__(self, viewer: Viewer, session: CalibrationSession, operated: Operated, step: str) -> None:
        self._viewer, self._session, self._step = viewer, session, step
        self._shown: Sequence[float] | None = None
        with ui.element("div").classes("stack"):
            ui.label("Begin untouched with the force that the gauge shows then, usually 0.").classes("muted")
            with ui.element("div").classes("row"):
                self._force = unit_field("Force that the gauge shows", unit="N").props("autofocus")
                self._force.on("keydown.enter", self._press)
                take = ui.button("Take a frame", icon="photo_camera", on_click=self._press).props("no-caps unelevated")
            self._table = ui.element("div").classes("calibrate-forces")
            with ui.element("div").classes("row"):
                keep = ui.button("It is back at 0: keep it", icon="check", on_click=self._keep).props("no-caps outline")
                undo = ui.button("Remove the last", icon="undo", on_click=self._undo).props("no-caps outline")
        for control in (self._force, take, keep, undo):
            operated.add(control)

    def show(self, forces_n: Sequence[float]) -> None:
        """Show the forces so far."""
        if forces_n == self._shown:
            return
        self._shown = forces_n
        self._table.clear()
        with self._table:
            ui.label(f"{len(forces_n)} frames" if forces_n else "No frame yet.").classes("muted")
            for force in forces_n:
                ui.label(f"{force:g} N").classes("chip")

    async def _press(self) -> None:
        text = str(self._force.value or "")
        if await self._viewer.attempt(self._pressed, text) is not None:
            self._force.set_value("")

    def _pressed(self, text: str) -> int:
        force = typed_number("force", text.replace(",", "."))
        with field_words(FORCE):
            return self._session.press(self._step, force, by=self._viewer.identity)

    async def _undo(self) -> None:
        await self._viewer.attempt(self._session.unpress, self._step, by=self._viewer.identity)

    async def _keep(self) -> None:
        await self._viewer.attempt(self._session.keep_presses, self._step, by=self._viewer.identity)
