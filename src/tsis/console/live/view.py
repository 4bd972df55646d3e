"""Elements of a page that show the live frames over one shared connection."""

from __future__ import annotations

import json
from bisect import bisect_left
from itertools import accumulate
from typing import TYPE_CHECKING, Any

from nicegui.element import Element

from tsis.console.live.hub import FIRST_MAP, FULL, checked_ends, packed_colours

if TYPE_CHECKING:
    from tsis.console.services.state import InstrumentState


ADDRESS = "/live"


class FrameElement(Element, esm={"tsis-live": "browser"}):
    """An element that shows frames.

    Props other than text are JSON: all props are sent when one changes, and the browser would take an equal list for a
    new one and redraw.
    """

    def __init__(self) -> None:
        super().__init__()
        self._props["address"] = ADDRESS

    def _set(self, name: str, value: Any) -> None:
        if self._props.get(name) != value:
            self._props[name] = value  # which updates the browser


class ColouredFrames(FrameElement):
    """An element that shows frames in a colour map of `MAPS`, with the scale of a pixel."""

    def __init__(self, *, map_name: str = FIRST_MAP, ends: str | tuple[float, float] = (0.0, FULL)) -> None:
        super().__init__()
        self._props["scale"] = json.dumps(None)
        self.colour(map_name)
        self.ends(ends)

    def colour(self, map_name: str) -> None:
        """Choose the colour map; the frames sent stay the same. Raises `UnknownNameError`."""
        self._set("map", json.dumps(packed_colours(map_name)))

    def ends(self, ends: str | tuple[float, float]) -> None:
        """Choose the levels of 255 that get the map's two end colours; ``"auto"`` follows the frames.

        Raises `InputError` when they lie outside [0, 255], or the upper one does not exceed the lower one.
        """
        self._set("range", json.dumps(checked_ends(ends)))

    def update_state(self, state: InstrumentState) -> None:
        """Set the scale from the instrument's state."""
        scale = state.camera.mm_per_pixel
        self._set("scale", json.dumps(scale))


class LiveView(ColouredFrames, component="live_view.js"):
    """Shows the latest frame with a colour map, a scale bar, and the contact drawn over it; parameters as there."""

    def __init__(self, *, map_name: str = FIRST_MAP, ends: str | tuple[float, float] = (0.0, FULL)) -> None:
        super().__init__(map_name=map_name, ends=ends)
        self._props["overlay"] = True
        self._props["frozen"] = self._props["marks"] = False
        self._props["label"] = "live image of the probe"
        self._props["notice"] = ""

    def overlay(self, shown: bool) -> None:
        """Show or hide outline and centroid of the contact."""
        self._set("overlay", bool(shown))

    def freeze(self, frozen: bool) -> None:
        """Keep the image that is shown, or follow the frames again; the camera goes on."""
        self._set("frozen", bool(frozen))

    def mark_limits(self, marked: bool) -> None:
        """Mark saturated pixels red and black ones blue."""
        self._set("marks", bool(marked))

    def update_state(self, state: InstrumentState) -> None:
        """Set scale and text from the instrument's state."""
        super().update_state(state)
        self._set("label", f"live image of the probe: {analysis_text(state)}")
        self._set("notice", notice(state))


class SurfaceView(ColouredFrames, component="surface_view.js"):
    """Shows the latest frame as a relief that can be turned; parameters as `ColouredFrames`."""

    def __init__(self, *, map_name: str = FIRST_MAP, ends: str | tuple[float, float] = (0.0, FULL)) -> None:
        super().__init__(map_name=map_name, ends=ends)
        self._props["label"] = "relief of the live image"

    def update_state(self, state: InstrumentState) -> None:
        """Set scale and text from the instrument's state."""
        super().update_state(state)
        self._set("label", f"relief of the live image: {analysis_text(state)}; arrow keys turn it")


class Histogram(FrameElement, component="histogram.js"):
    """Shows the number of pixels per grey level, logarithmic at first with ``log``, and problems of the exposure."""

    def __init__(self, *, log: bool = True) -> None:
        super().__init__()
        self._props["log"] = log
        self._props["label"] = "grey levels of the newest frame"

    def update_state(self, state: InstrumentState) -> None:
        """Set the text from the instrument's state."""
        self._set("label", f"grey levels of the newest frame: {histogram_text(state)}")


def analysis_text(state: InstrumentState) -> str:
    """The newest frame as text, for screen readers."""
    if not state.camera.running or state.frame_analysis is None:
        return "no frames"
    contact = state.frame_analysis.contact
    if contact is None:
        return "nothing is pressed"
    return "contact around column {:.0f}, row {:.0f}".format(*contact.centroid_px)


def histogram_text(state: InstrumentState) -> str:
    """A histogram as text, for screen readers."""
    analysis = state.frame_analysis
    if not state.camera.running or analysis is None:
        return "no frames"
    upto = list(accumulate(analysis.histogram))
    half = bisect_left(upto, upto[-1] / 2) + 1
    return f"half of the pixels below {half / len(upto):.0%} of full scale, {analysis.clipped_share:.1%} at it"


def notice(state: InstrumentState) -> str:
    """Why the image may be old; empty while frames arrive."""
    if not state.camera.running:
        return f"{state.busy} …" if state.busy else "the camera is stopped"
    return "the camera is away; this is its last frame" if state.camera.lost else ""
