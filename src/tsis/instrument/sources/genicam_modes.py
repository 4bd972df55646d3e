"""The modes of a GenICam camera: grey pixel formats, the region it sends, its rate."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.instrument.camera import Mode
from tsis.instrument.sources.genicam_nodes import ChoiceNode, choice_node, first_number, number_node
from tsis.instrument.sources.genicam_settings import adjust
from tsis.instrument.sources.grey_formats import FULL_SCALE
from tsis.model.errors import CameraError

if TYPE_CHECKING:
    from tsis.instrument.sources.genicam_nodes import Nodes, NumberNode

_RATES = (
    "ResultingFrameRate",
    "ResultingFrameRateAbs",
    "AcquisitionResultingFrameRate",
    "AcquisitionFrameRate",
    "AcquisitionFrameRateAbs",
)


def modes(nodes: Nodes) -> tuple[Mode, ...]:
    """Each grey format at the present size and at the full one; the present format and size first.

    The rate is told for the present size alone: a camera tells it for no other.

    Raises
    ------
    CameraError
        When the camera does not tell its size or offers no grey format.
    """
    formats = _grey_formats(nodes)
    width, height = _size(nodes)
    found = first_number(nodes, _RATES)
    rate = found[1].value if found is not None and 1e-3 <= found[1].value <= 1e5 else None
    full = _full("WidthMax", nodes, width), _full("HeightMax", nodes, height)
    present = (int(width.value), int(height.value))
    sizes = [(*present, rate)] if full == present else [(*present, rate), (*full, None)]
    return tuple(
        Mode(width_px=w, height_px=h, full_scale=FULL_SCALE[name], frames_per_s=fps, pixel_format=name)
        for w, h, fps in sizes
        for name in formats
    )


def apply_mode(nodes: Nodes, mode: Mode) -> None:
    """Bring the camera into ``mode``; a size other than the present one becomes a region in the middle of the sensor.

    Raises
    ------
    CameraError
        When the camera does not offer the format or the size.
    InputError
        When it does not take the rate.
    """
    formats = _grey_formats(nodes)
    if mode.pixel_format not in formats or mode.full_scale != FULL_SCALE[mode.pixel_format]:
        known = ", ".join(f"{name} (full scale {FULL_SCALE[name]:g})" for name in formats)
        raise CameraError(f"the camera has no mode {mode.label} of full scale {mode.full_scale:g}; it offers {known}")
    held = choice_node(nodes, "PixelFormat")
    if held is not None and held.value != mode.pixel_format:
        nodes.write("PixelFormat", mode.pixel_format)
    width, height = _size(nodes)
    if (width.value, height.value) != (mode.width_px, mode.height_px):
        _resize(nodes, mode)
    found = first_number(nodes, _RATES)
    if mode.frames_per_s is not None and (found is None or found[1].value != mode.frames_per_s):
        adjust(nodes, "frames_per_s", mode.frames_per_s)


def _grey_formats(nodes: Nodes) -> list[str]:
    held = choice_node(nodes, "PixelFormat") or ChoiceNode(value="", options=())
    grey = [name for name in held.options if name in FULL_SCALE]
    if not grey:
        offered = ", ".join(held.options) or "none"
        raise CameraError(f"the camera must offer a grey pixel format ({', '.join(FULL_SCALE)}); it offers {offered}")
    return sorted(grey, key=lambda name: (name != held.value, FULL_SCALE[name]))


def _size(nodes: Nodes) -> tuple[NumberNode, NumberNode]:
    width, height = number_node(nodes, "Width"), number_node(nodes, "Height")
    if width is None or height is None:
        raise CameraError("the camera does not tell the size of its frames")
    return width, height


def _full(name: str, nodes: Nodes, present: NumberNode) -> int:
    sensor = number_node(nodes, name)
    return int(present.high if sensor is None else sensor.value)


def _resize(nodes: Nodes, mode: Mode) -> None:
    for offset in ("OffsetX", "OffsetY"):
        held = number_node(nodes, offset)
        if held is not None and held.value != held.low:
            nodes.write(offset, held.low)  # a size may only grow as far as the offset leaves room
    for name, offset, wanted in (("Width", "OffsetX", mode.width_px), ("Height", "OffsetY", mode.height_px)):
        held = number_node(nodes, name)
        if held is None or held.nearest(wanted) != wanted:
            room = "" if held is None else f"; its {name} goes from {held.low:g} to {held.high:g} by {held.step:g}"
            raise CameraError(f"the camera has no mode {mode.label}{room}")
        nodes.write(name, wanted)
        place = number_node(nodes, offset)
        if place is not None and place.high > place.low:
            nodes.write(offset, place.nearest((place.low + place.high) / 2))
