"""The probe's fields: face, layers, lamps."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.design.draft import draft_of
from tsis.console.pages.design.layer_table import LayerTable
from tsis.console.pages.design.typed import Sentences, typed_field
from tsis.console.pages.headings import panel_title
from tsis.model import list_probes

if TYPE_CHECKING:
    from collections.abc import Callable

    from nicegui.events import ValueChangeEventArguments

    from tsis.console.pages.design.desk import DrawingDesk

LAMP_LABELS = {"height_mm": "Height / mm", "aim_deg": "Aim / °", "half_angle_deg": "Half-angle / °"}


class ProbeForm:
    """All fields of the probe, filled from a probe of the catalog.

    Parameters
    ----------
    desk
        What they fill.
    changed
        Called after each change.
    """

    def __init__(self, desk: DrawingDesk, changed: Callable[[], object]) -> None:
        self._desk, self._changed = desk, changed
        panel_title("Probe")
        ui.select(list(list_probes()), value=desk.probe.start.name, label="Start from", on_change=self._start).props(
            "dense outlined options-dense"
        ).classes("start")
        self._place = ui.element("div").classes("stack")
        self._fill()

    def _start(self, event: ValueChangeEventArguments[str]) -> None:
        self._desk.probe = draft_of(event.value)
        self._fill()
        self._changed()

    def _fill(self) -> None:
        self._place.clear()
        with self._place:
            self._face()
            panel_title("Layers, from the tissue up", level=3)
            LayerTable(self._desk.probe, self._changed)
            self._lamps()

    def _face(self) -> None:
        draft = self._desk.probe

        def radius(text: str) -> None:
            draft.radius_mm = text
            self._changed()

        def curvature(text: str) -> None:
            draft.curvature_mm = text
            self._changed()

        def domed(event: ValueChangeEventArguments[bool | None]) -> None:
            draft.domed = bool(event.value)
            self._fill()
            self._changed()

        panel_title("Face", level=3)
        fields = ui.element("div").classes("fields")
        sentences = Sentences()
        with fields:
            typed_field("Radius / mm", draft.radius_mm, radius, partial(draft.face_fault, "radius_mm"), sentences)
            ui.switch("Domed", value=draft.domed, on_change=domed).props("dense")
            if draft.domed:
                fault = partial(draft.face_fault, "curvature_mm")
                typed_field("Radius of the dome / mm", draft.curvature_mm, curvature, fault, sentences)

    def _lamps(self) -> None:
        draft = self._desk.probe

        def lamps(text: str) -> None:
            draft.lamps = text
            self._changed()

        def lamp(name: str, text: str) -> None:
            draft.lamp[name] = text
            self._changed()

        panel_title("Lamps around the side", level=3)
        fields = ui.element("div").classes("fields four")
        sentences = Sentences()
        with fields:
            typed_field("How many", draft.lamps, lamps, partial(draft.lamp_fault, "lamps"), sentences)
            for name, label in LAMP_LABELS.items():
                typed_field(label, draft.lamp[name], partial(lamp, name), partial(draft.lamp_fault, name), sentences)
