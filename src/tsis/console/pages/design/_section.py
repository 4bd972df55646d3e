"""Drawing of the edited probe."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.components import drawing, panel_title, show_drawing
from tsis.errors import InputError
from tsis.plots import probe_section
from tsis.report import Picture, address

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tsis.console.pages.components import Viewer
    from tsis.console.pages.design._draft import ProbeEditor
    from tsis.model import Probe


EMPTY = "data:image/svg+xml,%3Csvg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 24 12'/%3E"
WIDE_IN, LABELS_IN = 6.0, 0.65  # of the picture; of the labels beside and below its axes
LEAST_IN, MOST_IN = 1.8, 4.5  # of its height


class Section:
    """The probe from the side; with a wrong field its message and the last valid probe."""

    def __init__(self, editor: ProbeEditor, viewer: Viewer) -> None:
        self._editor, self._viewer = editor, viewer
        self._requested = 0
        panel_title("Seen from the side")
        with ui.element("div").classes("section"):
            self._picture = drawing()
            show_drawing(self._picture, EMPTY, "the probe, not yet drawn")
        self._fault = ui.label().classes("doubtful").props('role="status"')

    async def draw(self) -> None:
        """Draw the probe as it is now."""
        self._requested += 1
        turn = self._requested
        try:
            probe = self._editor.probe.probe()
        except InputError as error:
            beside = any(self._editor.probe.field_faults())  # which has its own message
            self._fault.text = "Not drawn while a field is wrong." if beside else f"Not drawn: {error}"
            return
        self._fault.text = ""
        source = await self._viewer.attempt(address, picture_of(probe))
        if source is not None and turn == self._requested:  # what was typed meanwhile is drawn by who typed it
            show_drawing(self._picture, source, described(probe))


def picture_of(probe: Probe) -> Picture:
    """The probe's section as a picture."""
    span, up = 2 * probe.radius_mm + 4.8, probe.thickness_mm + probe.glass.thickness_mm + 2  # as they are drawn
    height = min(max((WIDE_IN - LABELS_IN) * up / span + LABELS_IN, LEAST_IN), MOST_IN)
    return Picture(title="", draw=partial(_draw, probe), size=(WIDE_IN, height), alt=described(probe))


def described(probe: Probe) -> str:
    """The probe as text."""
    layers = ", ".join(f"{layer.thickness_mm:g} mm of {layer.young_kpa:g} kPa" for layer in probe.layers)
    face = "flat" if probe.face_curvature_mm is None else f"domed by {probe.face_curvature_mm:g} mm"
    return (
        f"Section of the probe: face of {2 * probe.radius_mm:g} mm, {face}; from the tissue up {layers}, glass; "
        f"{len(probe.leds)} lamps"
    )


def _draw(probe: Probe, figure: Figure) -> None:
    probe_section(probe, figure.subplots())
