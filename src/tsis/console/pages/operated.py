"""Controls that only who holds the camera may use: everybody sees them, and is told why they do nothing for him."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

from nicegui import ui

if TYPE_CHECKING:
    from nicegui.elements.mixins.disableable_element import DisableableElement

    from tsis.console.bench import BenchState
    from tsis.console.pages.viewer import Viewer

Control = TypeVar("Control", bound="DisableableElement")


class Operated:
    """The controls of one page.

    Parameters
    ----------
    viewer
        Who looks at the page.
    """

    def __init__(self, viewer: Viewer) -> None:
        self._viewer = viewer
        self._controls: list[DisableableElement] = []
        self._judged = False  # before the first look nothing that controls say is true yet

    def add(self, control: Control) -> Control:
        """Hold a control back from those who watch."""
        self._controls.append(control)
        control.set_enabled(self._judged and self._viewer.acts)
        return control

    def why(self) -> None:
        """Place the sentence that says why controls do nothing; it is there only while they do not."""
        self._sentence = ui.label().classes("muted watching").props("role=status")

    def show(self, _: BenchState) -> None:
        """Enable the controls for who holds the camera."""
        acts, self._judged = self._viewer.acts, True
        self._controls = [control for control in self._controls if not control.is_deleted]
        for control in self._controls:
            if control.enabled != acts:
                control.set_enabled(acts)
        self._sentence.set_visibility(not acts)
        self._sentence.text = "You watch: take the camera, at the top of the page, to use what is grey here."
