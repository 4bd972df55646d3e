"""The one button that starts the camera, or stops it: it does what it says, however late the click arrives."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.loading import loading

if TYPE_CHECKING:
    from tsis.console.bench import Bench
    from tsis.console.bench.state import CameraState
    from tsis.console.pages.viewer import Viewer


class RunButton:
    """Start or Stop.

    Parameters
    ----------
    bench
        Whose camera.
    viewer
        Who clicks.
    """

    def __init__(self, bench: Bench, viewer: Viewer) -> None:
        self._bench, self._viewer = bench, viewer
        self._runs: bool | None = None  # as the button says; None before anything is known
        self.element = ui.button("Start", on_click=self._clicked).props("no-caps outline").classes("run")

    def show(self, camera: CameraState) -> None:
        """Say what a click would do."""
        self._runs = camera.running
        self.element.text = "Stop" if self._runs else "Start"
        self.element.set_icon("stop" if self._runs else "play_arrow")

    async def _clicked(self) -> None:
        if self._runs is None:
            return
        act = self._bench.stop if self._runs else self._bench.start  # a second click on Start starts nothing more
        with loading(self.element):
            await self._viewer.attempt(act, by=self._viewer.identity)
