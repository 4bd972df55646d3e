"""Sentences one under the other, as a list that readers of the screen know as one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

if TYPE_CHECKING:
    from collections.abc import Iterable

    from nicegui.element import Element


def sentence_list(sentences: Iterable[str] = ()) -> Element:
    """Place a list with these sentences; others can be `listed` in it."""
    with ui.element("ul").classes("sentences") as place:
        for sentence in sentences:
            listed(sentence)
    return place


def listed(sentence: str, look: str = "") -> None:
    """Place a sentence in a list."""
    with ui.element("li"):
        ui.label(sentence).classes(look)
