"""What a dialog says when somebody else has changed a record meanwhile."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from tsis.console.pages.records.edits import Edited


def show_conflict(place: ui.element, found: Edited[Any], *, take: Callable[[], Any], keep: Callable[[], Any]) -> None:
    """Say what is there now, and let one choose: ``take`` what is there, or ``keep`` and save one's own."""
    place.clear()
    with place, ui.element("div").classes("conflict").props('role="alert"'):
        ui.label(found.refused).classes("flag")
        for difference in found.differences or ("What you edit is as it was; something else of it was changed.",):
            ui.label(difference)
        with ui.element("div").classes("row"):
            ui.button("Take what is there now", on_click=take).props("dense no-caps outline")
            ui.button("Save mine over it", on_click=keep).props("dense no-caps outline")
