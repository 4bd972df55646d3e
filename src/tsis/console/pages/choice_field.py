"""A choice among few things, shown as the bench has it and changed by who holds the camera."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.console.pages.just_done import JustDone

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from nicegui.elements.choice_element import ChoiceElement
    from nicegui.events import ValueChangeEventArguments

    from tsis.console.pages.viewer import Viewer


class ChoiceField:
    """Keeps a select or a toggle in step with the bench.

    Parameters
    ----------
    viewer
        Who chooses.
    element
        The select or toggle.
    act
        Done with what was chosen, away from the event loop; when it fails, its sentence is told and the bench's choice
        is shown again.
    """

    def __init__(self, viewer: Viewer, element: ChoiceElement, act: Callable[[str], object]) -> None:
        self._viewer, self.element, self._act = viewer, element, act
        self._shown: str | None = element.value
        self._under_way, self._just_done = False, JustDone()
        element.on_value_change(self._chosen)

    def show(self, value: str | None, options: Mapping[str, str] | None = None) -> None:
        """Show the bench's choice and what may be chosen, unless another choice is being made."""
        if self._just_done.is_old(value):
            return
        if options is not None and self.element.options != dict(options):
            self._shown = value
            self.element.set_options(dict(options), value=value)
        if not self._under_way and self.element.value != value:
            self._shown = value
            self.element.set_value(value)
        elif not self._under_way:
            self._shown = value

    async def _chosen(self, event: ValueChangeEventArguments[str]) -> None:
        before = self._shown
        if event.value == before or self._under_way:
            return
        self._under_way = True
        try:
            done = await self._viewer.attempt(lambda: (self._act(event.value), True)[1])
        finally:
            self._under_way = False
        self.show(event.value if done else before)
        if done:
            self._just_done.replaced(before)
