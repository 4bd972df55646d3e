"""A class of a style sheet that an element has or has not."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from nicegui.element import Element


def classed(element: Element, name: str, wanted: bool) -> None:
    """Give an element a class, or take it."""
    if wanted:
        element.classes(add=name)
    else:
        element.classes(remove=name)
