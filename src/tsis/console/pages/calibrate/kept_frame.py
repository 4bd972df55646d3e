"""A frame of a step that is done, so that people see whether it shows what it should."""

from __future__ import annotations

import base64
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.files.thumbnail import GREY, thumbnail_png
from tsis.console.pages.report_parts import show_drawing

if TYPE_CHECKING:
    from tsis.calibration.session import CalibrationStep
    from tsis.console.bench.calibrating import CalibrationSession, StepState
    from tsis.console.pages.viewer import Viewer

SIZE_PX = 560  # of its longer side


class KeptFrame:
    """The frame in the middle of a step, in loadings near the largest force.

    Parameters
    ----------
    viewer
        Who looks.
    session
        Whose frames.
    """

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
        found = await self._viewer.attempt(self._read, state.step)
        if found is None or self._shown != name:
            return
        content, caption = found
        self._caption.text = caption
        source = f"data:image/png;base64,{base64.b64encode(content).decode()}"
        show_drawing(self._image, source, f"Frame of step {name}")
        self._figure.set_visibility(True)

    def _read(self, step: CalibrationStep) -> tuple[bytes, str]:
        shot = self._session.folder.middle_shot(step)
        content = thumbnail_png(shot.image.grey, full_scale=shot.image.full_scale, size=SIZE_PX, name=GREY)
        force = "" if shot.force_n is None else f", at {shot.force_n:.2f} N"
        return content, f"A frame of {step.name}{force}; its mean grey level is {shot.image.grey.mean():.1f}."
