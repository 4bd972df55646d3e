"""Two frames side by side, in turn, or subtracted."""

from __future__ import annotations

from itertools import count
from typing import TYPE_CHECKING

import numpy as np
from nicegui import ui

from tsis.console import widgets
from tsis.console.live.hub import DIFFERENCE, FULL
from tsis.console.live.measuring import MeasuringTools
from tsis.console.live.view import StillView
from tsis.model.image import TactileImage

if TYPE_CHECKING:
    from collections.abc import Sequence


SIDE, BLINK, SUBTRACTED = "side", "blink", "difference"
WAYS = {SIDE: "Side by side", BLINK: "Blink", SUBTRACTED: "Difference"}
BLINK_S = 0.7  # for which each of the two is shown
_groups = count(1)


def signed(change: TactileImage) -> tuple[TactileImage, float]:
    """A difference with a full scale that has zero in its middle, and the grey level of black, below zero."""
    most = max(float(np.abs(change.grey).max()), 0.5)
    image = TactileImage(grey=change.grey, mm_per_pixel=change.mm_per_pixel, full_scale=2.0 * most, name=change.name)
    return image, -most


class FrameComparison:
    """The two frames, and their difference where they can be subtracted, all measured by one choice of tool each."""

    def __init__(self, images: Sequence[TactileImage], change: TactileImage | None) -> None:
        group, top = f"compared {next(_groups)}", max(float(image.grey.max()) for image in images)
        self._first = True
        with ui.element("div").classes("row tools"):
            ways = {name: label for name, label in WAYS.items() if change is not None or name != SUBTRACTED}
            self.way = ui.toggle(ways, value=SIDE, on_change=lambda: self._show())
            self.way.props(
                'dense unelevated toggle-color=primary no-caps role=group aria-label="How they are compared"'
            )
            self.way.classes("roles")
        self._places: list[ui.element] = []
        with ui.element("div").classes("live-pair two") as self._pair:
            for image in images:
                self._place(image, group, high=top / image.full_scale * FULL)
            if change is not None:
                shown, zero = signed(change)
                self._place(shown, group, zero=zero, title="The first minus the second: red where it is brighter")
        self._timer = ui.timer(BLINK_S, self._turn, active=False)
        self._show()

    def _place(
        self, image: TactileImage, group: str, *, high: float = FULL, zero: float = 0.0, title: str = ""
    ) -> None:
        with ui.element("div").classes("compared-frame") as place:
            widgets.muted(title or image.name)
            view = StillView(title or image.name, group=group)
            if zero:
                view.colour(DIFFERENCE)
            view.ends((0.0, min(max(high, 1.0), FULL)))
            view.show(image, zero=zero)
            MeasuringTools(view, lambda: image)
        self._places.append(place)

    def _show(self) -> None:
        way = self.way.value
        widgets.set_class(self._pair, "two", way == SIDE)
        self._first = True
        for at, place in enumerate(self._places):
            shown = at < 2 if way == SIDE else at == 0 if way == BLINK else at == 2
            place.set_visibility(shown)
        self._timer.active = way == BLINK

    def _turn(self) -> None:
        self._first = not self._first
        self._places[0].set_visibility(self._first)
        self._places[1].set_visibility(not self._first)
