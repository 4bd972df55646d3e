"""What everybody must know: trouble, said at once; who holds the camera, said when there is time."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

if TYPE_CHECKING:
    from tsis.console.bench import BenchState
    from tsis.console.pages.viewer import Viewer


class Notices:
    """The banner below the header; empty when all is well.

    Parameters
    ----------
    viewer
        Who reads it.
    """

    def __init__(self, viewer: Viewer) -> None:
        self._viewer = viewer
        self._trouble = ui.element("div").classes("banner").props('role="alert"').mark("banner")
        self._calm = ui.element("div").classes("banner").props('role="status"').mark("watching")
        self._said: tuple[tuple[str, ...], str] = ((), "")

    def show(self, now: BenchState) -> None:
        """Say what has changed; what stays is not said again."""
        watching = ""
        if now.holder is not None and now.holder.identity != self._viewer.identity:
            watching = f"{now.holder.name} holds the camera; you watch."
        trouble, before = self._said
        if trouble != now.trouble:
            self._trouble.clear()
            with self._trouble:
                for sentence in now.trouble:
                    ui.label(sentence)
        if before != watching:
            self._calm.clear()
            with self._calm:
                if watching:
                    ui.label(watching).classes("calm")
        self._said = (now.trouble, watching)
