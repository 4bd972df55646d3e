"""The camera in use: its name, whether it runs, and its mode."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.camera.choosing import choose_and_start
from tsis.console.pages.choice_field import ChoiceField
from tsis.console.pages.headings import panel_title
from tsis.console.pages.run_button import RunButton

if TYPE_CHECKING:
    from tsis.console.bench import Bench, BenchState
    from tsis.console.bench.state import CameraState
    from tsis.console.pages.operated import Operated
    from tsis.console.pages.viewer import Viewer


class ChosenPanel:
    """What is looked through now.

    Parameters
    ----------
    bench
        Whose camera it is.
    viewer
        Who looks.
    operated
        Takes the controls.
    """

    def __init__(self, bench: Bench, viewer: Viewer, operated: Operated) -> None:
        self._bench, self._viewer = bench, viewer
        with ui.element("div").classes("row"):
            with ui.element("div"):
                panel_title("Camera in use")
                self._name = ui.label()
                self._how = ui.label().classes("muted")
            ui.element("div").classes("spring")
            select = ui.select({}, label="Mode").props("dense outlined").classes("mode")
            self._mode = ChoiceField(viewer, select, self._in_mode)
            self._run = RunButton(bench, viewer)
            ui.link("Examine", "/")
        operated.add(select)
        operated.add(self._run.element)

    def show(self, state: BenchState) -> None:
        """Show the camera's state."""
        camera = state.camera
        self._name.text = camera_words(camera)
        self._how.text = how_words(camera)
        self._mode.show(camera.mode or None, {label: label for label in camera.modes})
        self._mode.element.set_visibility(bool(camera.modes))
        self._run.show(camera)

    def _in_mode(self, label: str) -> None:
        choose_and_start(self._bench, replace(self._bench.desk.choice, mode=label), by=self._viewer.identity)


def camera_words(camera: CameraState) -> str:
    """Its name, or what was chosen before it was connected."""
    if camera.name:
        return camera.name
    choice = camera.choice
    return f"virtual probe {choice.probe} on {choice.phantom}" if choice.is_virtual else choice.spec


def how_words(camera: CameraState) -> str:
    """Whether frames come."""
    if not camera.running:
        return "stopped"
    if camera.lost:
        return f"away: {camera.failure}" if camera.failure else "away"
    return f"runs at {camera.frames_per_s:.0f} frames/s, {camera.columns} x {camera.rows} pixels"
