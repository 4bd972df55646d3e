"""Elements of a page that show frames."""

from __future__ import annotations

import base64
import json
from typing import TYPE_CHECKING, Any

from nicegui.element import Element
from nicegui.elements import echart, leaflet

from tsis.console.live.hub import FIRST_MAP, FULL, checked_ends, packed_colours, still_packet

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    from nicegui.events import GenericEventArguments

    from tsis.console.services.state import InstrumentState
    from tsis.model.image import TactileImage


ADDRESS = "/live"
LIBRARIES: tuple[ModuleType, ...] = (leaflet, echart)  # of the elements; loading one makes the browser find it
Point = tuple[float, float]


class ColouredFrames(Element, esm={"tsis-live": "browser"}):
    """An element that shows frames in a colour map of `MAPS`, with the scale of a pixel.

    Props other than text are JSON: all props are sent when one changes, and the browser would take an equal list for a
    new one and redraw.
    """

    def __init__(self, *, map_name: str = FIRST_MAP, ends: Point = (0.0, FULL), gamma: float = 1.0) -> None:
        super().__init__()
        self.scale(None)
        self.colour(map_name)
        self.ends(ends, gamma)

    def _set(self, name: str, value: Any) -> None:
        if self._props.get(name) != value:
            self._props[name] = value  # which updates the browser

    def colour(self, map_name: str) -> None:
        """Choose the colour map; the frames sent stay the same. Raises `UnknownNameError`."""
        self._set("map", json.dumps(packed_colours(map_name)))

    def ends(self, ends: Point, gamma: float = 1.0) -> None:
        """Choose the levels of 255 that get the map's two end colours, and the exponent of what lies between them.

        Raises `InputError` when they lie outside [0, 255], or the upper one does not exceed the lower one.
        """
        self._set("range", json.dumps(checked_ends(ends, gamma)))

    def scale(self, mm_per_pixel: Point | None) -> None:
        """Set the size (x, y) of a pixel in mm; None when it is unknown."""
        self._set("scale", json.dumps(mm_per_pixel))


class FrameView(ColouredFrames, component="frame_view.js"):
    """A frame that is zoomed, read and measured; ``group`` names views that zoom as one."""

    def __init__(self, label: str, *, map_name: str = FIRST_MAP, group: str = "") -> None:
        super().__init__(map_name=map_name)
        self._props.update({"label": label, "notice": "", "tool": "", "group": group})
        self._props["overlay"] = self._props["frozen"] = self._props["marks"] = False

    def mark_limits(self, marked: bool) -> None:
        """Mark saturated pixels red and black ones blue."""
        self._set("marks", bool(marked))

    def measure(self, tool: str) -> None:
        """Draw what is measured: one of `tsis.console.live.measuring.TOOLS`, empty for nothing."""
        self._set("tool", tool)

    def on_shape(self, act: Callable[[str, Point, Point], object]) -> None:
        """Call ``act`` with the tool and its two points (x, y) in pixels, as they are moved."""

        def moved(event: GenericEventArguments) -> object:
            tool, *points = event.args
            (x, y), (end_x, end_y) = points
            return act(str(tool), (float(x), float(y)), (float(end_x), float(end_y)))

        self.on("shape", moved, throttle=0.1)


class StillView(FrameView):
    """Shows a single frame."""

    def show(self, image: TactileImage, *, zero: float = 0.0) -> None:
        """Show a frame; ``zero`` is the grey level of black, below zero for a difference of frames."""
        self.scale(image.mm_per_pixel)
        self._set("still", base64.b64encode(still_packet(image, zero=zero)).decode())


class LiveView(FrameView):
    """Shows the latest frame with the contact drawn over it."""

    def __init__(self, *, map_name: str = FIRST_MAP) -> None:
        super().__init__("live image of the probe", map_name=map_name)
        self._props["address"] = ADDRESS
        self._props["overlay"] = True

    def overlay(self, shown: bool) -> None:
        """Show or hide outline and centroid of the contact."""
        self._set("overlay", bool(shown))

    def freeze(self, frozen: bool) -> None:
        """Keep the image that is shown, or follow the frames again; the camera goes on."""
        self._set("frozen", bool(frozen))

    def update_state(self, state: InstrumentState) -> None:
        """Set scale and text from the instrument's state."""
        self.scale(state.camera.mm_per_pixel)
        self._set("label", f"live image of the probe: {analysis_text(state)}")
        self._set("notice", notice(state))


class SurfaceView(ColouredFrames, component="surface_view.js"):
    """Shows the latest frame as a relief that can be turned."""

    def __init__(self, *, map_name: str = FIRST_MAP, ends: Point = (0.0, FULL), gamma: float = 1.0) -> None:
        super().__init__(map_name=map_name, ends=ends, gamma=gamma)
        self._props["address"] = ADDRESS
        self._props["label"] = "relief of the live image"

    def update_state(self, state: InstrumentState) -> None:
        """Set scale and text from the instrument's state."""
        self.scale(state.camera.mm_per_pixel)
        self._set("label", f"relief of the live image: {analysis_text(state)}; arrow keys turn it")


def analysis_text(state: InstrumentState) -> str:
    """The newest frame as text, for screen readers."""
    if not state.camera.running or state.frame_analysis is None:
        return "no frames"
    contact = state.frame_analysis.contact
    if contact is None:
        return "nothing is pressed"
    return "contact around column {:.0f}, row {:.0f}".format(*contact.centroid_px)


def notice(state: InstrumentState) -> str:
    """Why the image may be old; empty while frames arrive."""
    if not state.camera.running:
        return f"{state.busy} …" if state.busy else "the camera is stopped"
    return "the camera is away; this is its last frame" if state.camera.lost else ""
