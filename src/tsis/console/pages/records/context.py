"""What the parts of a target's page ask of the page."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from nicegui import ui

    from tsis.console.bench import Bench
    from tsis.console.pages.records.reading import TargetSeen
    from tsis.console.pages.viewer import Viewer


class ChosenPresses(Protocol):
    """The presses that the person has ticked."""

    chosen: list[str]


class TargetContext(Protocol):
    """The open page of a target, as its parts see it.

    Attributes
    ----------
    bench, viewer
        Whose store it is, and the browser tab.
    below, dialogs, compared
        Where messages, dialogs and a comparison are drawn.
    """

    bench: Bench
    viewer: Viewer
    below: ui.element
    dialogs: ui.element
    compared: ui.element

    @property
    def presses(self) -> ChosenPresses:
        """The table of presses."""

    async def load(self) -> None:
        """Read the target anew and show it."""

    async def compare(self, seen: TargetSeen) -> None:
        """Show the two chosen presses beside each other."""
