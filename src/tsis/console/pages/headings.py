"""Headings that readers of the screen can go by; below the page's own, which the shell gives."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

if TYPE_CHECKING:
    from nicegui.elements.label import Label


def panel_title(text: str, *, level: int = 2) -> Label:
    """The title of a panel."""
    title = ui.label(text).classes("panel-title").props("role=heading")
    title.props["aria-level"] = level
    return title
