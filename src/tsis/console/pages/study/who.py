"""Who does something that a study's log keeps: a login, or a name that is typed where nobody logged in."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.console.pages.number_field import unit_field

if TYPE_CHECKING:
    from nicegui import ui

    from tsis.console.pages.viewer import Viewer


def who_field(viewer: Viewer, label: str, before: str = "") -> ui.input:
    """Place a field for the name, with that of the viewer in it; of a login it cannot be another.

    Parameters
    ----------
    viewer
        Who looks.
    label
        What he would be.
    before
        Who was it before, for whom this may be gone on with.
    """
    field = unit_field(label, viewer.name if viewer.logged_in else before or viewer.name, keys="text")
    return field.props("readonly") if viewer.logged_in else field


def name_in(viewer: Viewer, field: ui.input) -> str:
    """The name to enter; a browser may send what it likes, so a login's is taken from the login."""
    return viewer.name if viewer.logged_in else (field.value or "").strip()


__all__ = ["name_in", "who_field"]
