"""A frame with all its tools."""

from __future__ import annotations

from typing import TYPE_CHECKING, Generic, TypeVar

from nicegui import ui

from tsis.console import widgets
from tsis.console.live.histogram import DisplayRange
from tsis.console.live.hub import FIRST_MAP, MAPS
from tsis.console.live.measuring import MeasuringTools
from tsis.console.live.view import FrameView, StillView

if TYPE_CHECKING:
    from collections.abc import Callable

    from nicegui.events import ValueChangeEventArguments

    from tsis.model.image import TactileImage

    Shown = Callable[[str, tuple[float, float], float], object]


View = TypeVar("View", bound=FrameView)


class FramePanel(Generic[View]):
    """A view under its tools.

    ``place`` makes the view with a colour map; ``frame`` gives the frame that is measured, in a thread; ``shown`` is
    called with map, ends and gamma when they change. ``switches`` and ``beside`` take what a page adds.
    """

    view: View

    def __init__(
        self,
        place: Callable[[str], View],
        frame: Callable[[], TactileImage | None],
        shown: Shown = lambda *_: None,
        *,
        map_name: str = FIRST_MAP,
    ) -> None:
        self._map, self._shown = map_name, shown
        self.view: View
        with ui.element("div").classes("row tools") as self.switches:
            colours = widgets.select_field(sorted(MAPS), value=map_name, label="Colours", on_change=self._colour)
            colours.classes("colours")
            ui.switch("Clipping", value=False, on_change=lambda event: self.view.mark_limits(bool(event.value)))
        with ui.element("div").classes("live-pair") as self.beside:
            self.view = place(map_name)
        self.tools = MeasuringTools(self.view, frame)
        self.range = DisplayRange(lambda *_: self.apply())

    def apply(self) -> None:
        """Show the frame in the colours that are chosen."""
        self.view.colour(self._map)
        self.view.ends(self.range.ends, self.range.gamma)
        self._shown(self._map, self.range.ends, self.range.gamma)

    def _colour(self, event: ValueChangeEventArguments[str]) -> None:
        self._map = event.value
        self.apply()


def still_panel(image: TactileImage, label: str) -> FramePanel[StillView]:
    """Place a single frame, of the store or a file, with all tools."""
    panel = FramePanel(lambda map_name: StillView(label, map_name=map_name), lambda: image)
    panel.view.show(image)
    panel.range.show_image(image)
    panel.range.automatic()
    return panel
