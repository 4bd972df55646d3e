"""Keys of the page Examine: space, the arrows and F."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nicegui import ui
from nicegui.element import Element

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable

KEYS = {"Space": "keep a snapshot", "←": "target before", "→": "target after", "F": "live image alone, and back"}


class Keys(Element, component="keys.js"):
    """Hears keys wherever the page has the focus but in a field.

    Parameters
    ----------
    snapshot
        Called at space.
    step
        Called with -1 or 1 at the arrows.
    alone
        What F shows alone, over the whole screen.
    """

    def __init__(
        self, *, snapshot: Callable[[], Awaitable[Any]], step: Callable[[int], Awaitable[Any]], alone: Element
    ) -> None:
        super().__init__()
        self._props["alone"] = alone.html_id
        self.on("snapshot", lambda: snapshot())
        self.on("step", lambda event: step(1 if event.args == 1 else -1))


def show_alone(button: ui.button) -> None:
    """Have a button do what F does; in the browser, for only at a click a page may fill the screen."""
    button.on("click", js_handler="() => document.dispatchEvent(new CustomEvent('tsis-alone'))")


def key_help() -> None:
    """The keys and what they do."""
    with ui.element("dl").classes("keys"):
        for key, does in KEYS.items():
            with ui.element("dt"), ui.element("kbd").classes("key"):
                ui.label(key)
            with ui.element("dd"):
                ui.label(does)
