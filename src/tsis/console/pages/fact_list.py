"""Terms and what they are, as a list that readers of the screen know as one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

if TYPE_CHECKING:
    from collections.abc import Iterable


class FactList:
    """A list of terms with their values; empty at first."""

    def __init__(self) -> None:
        self._list = ui.element("dl").classes("facts")
        self._shown: tuple[tuple[str, str], ...] = ()

    def show(self, found: Iterable[tuple[str, str]]) -> None:
        """Show these facts in place of those before."""
        facts = tuple(found)
        if facts == self._shown:
            return
        self._shown = facts
        self._list.clear()
        with self._list:
            for term, value in facts:
                with ui.element("dt"):
                    ui.label(term)
                with ui.element("dd"):
                    ui.label(value)
