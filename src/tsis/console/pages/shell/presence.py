"""Whether a page can be seen: one behind another tab need not be kept up to date."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui.element import Element

if TYPE_CHECKING:
    from nicegui.events import GenericEventArguments

    from tsis.console.pages.viewer import Viewer


class Presence(Element, component="presence.js"):
    """Tells the viewer when his page comes into sight and when it goes.

    Parameters
    ----------
    viewer
        Who is told.
    """

    def __init__(self, viewer: Viewer) -> None:
        super().__init__()

        def seen(event: GenericEventArguments) -> None:
            viewer.visible = event.args is not False

        self.on("seen", seen)
