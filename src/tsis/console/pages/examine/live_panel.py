"""The live image with its colours and overlay, the grey histogram, and the relief in three dimensions."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.live.element import Histogram, LiveView, SurfaceView
from tsis.console.pages.classed import classed
from tsis.console.pages.examine.keys import key_help, show_alone

if TYPE_CHECKING:
    from nicegui.events import ValueChangeEventArguments

    from tsis.console.bench import BenchState
    from tsis.console.bench.state import CameraState

FIRST_MAP = "viridis"
MAPS = ("grey", "cividis", "inferno", "viridis")


class LivePanel:
    """What the camera sees, for everybody who looks."""

    def __init__(self) -> None:
        self._map = FIRST_MAP
        self._surface: SurfaceView | None = None
        with ui.element("div").classes("panel live-panel") as self.alone:
            self._tools()
            with ui.element("div").classes("live-pair") as self._pair:
                self.view = LiveView(map_name=FIRST_MAP)
                self._surface_place = ui.element("div").classes("surface-place")
            self._surface_place.set_visibility(False)
            self._camera = ui.label().classes("muted camera-line")
        with ui.element("div").classes("panel histogram-panel"):
            self.histogram = Histogram()

    def _tools(self) -> None:
        with ui.element("div").classes("row tools"):
            ui.select(list(MAPS), value=FIRST_MAP, label="Colours", on_change=self._colour).props(
                "dense outlined"
            ).classes("colours")
            ui.switch("Contact", value=True, on_change=lambda event: self.view.overlay(bool(event.value)))
            ui.switch("3-D", value=False, on_change=self._three)
            ui.element("div").classes("spring")
            show_alone(ui.button(icon="fullscreen").props('flat dense round aria-label="Full screen"'))
            with ui.button(icon="keyboard").props('flat dense round aria-label="Keys"'), ui.menu():
                key_help()

    def show(self, state: BenchState) -> None:
        """Show how the camera is; the frames come by a way of their own."""
        self.view.tell(state)
        self.histogram.tell(state)
        if self._surface is not None:
            self._surface.tell(state)
        self._camera.text = f"{state.busy.capitalize()} …" if state.busy else camera_line(state.camera)

    def _colour(self, event: ValueChangeEventArguments[str]) -> None:
        self._map = event.value
        self.view.colour(event.value)
        if self._surface is not None:
            self._surface.colour(event.value)

    def _three(self, event: ValueChangeEventArguments[bool | None]) -> None:
        self._surface_place.set_visibility(bool(event.value))
        classed(self._pair, "two", bool(event.value))
        self._surface_place.clear()
        self._surface = None
        if event.value:
            with self._surface_place:
                self._surface = SurfaceView(map_name=self._map)


def camera_line(camera: CameraState) -> str:
    """Name, rate, losses and size, as the camera brings them."""
    if not camera.running:
        return "The camera is stopped."
    size = f", {camera.columns} x {camera.rows} pixels" if camera.columns else ""
    times = "once" if camera.interruptions == 1 else f"{camera.interruptions} times"
    breaks = f", interrupted {times}" if camera.interruptions else ""
    return f"{camera.name}: {camera.frames_per_s:.0f} frames/s, {camera.missed} dropped{breaks}{size}"
