"""Modes and settings of a camera under Aravis, in the units of the camera protocol."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import CameraError
from tsis.instrument._camera import Mode, Setting
from tsis.instrument.drivers._frame_numbers import FULL_SCALE

if TYPE_CHECKING:
    from collections.abc import Mapping

    from tsis.instrument.drivers.aravis._library import Aravis


AUTO_OFF, CONTINUOUS = 0, 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """A setting and its name in Aravis; the library's value is ``scale`` times ours."""

    name: str
    call: str
    unit: str
    scale: float = 1.0
    auto: str = ""


QUANTITIES = (
    Quantity(name="exposure_ms", call="exposure_time", unit="ms", scale=1000.0, auto="exposure"),
    Quantity(name="gain", call="gain", unit="", auto="gain"),
    Quantity(name="brightness", call="black_level", unit="", auto="black_level"),
    Quantity(name="frames_per_s", call="frame_rate", unit="1/s"),
)


def settings(aravis: Aravis, camera: int) -> tuple[Setting, ...]:
    """The adjustable settings, with present values and ranges."""
    return tuple(_setting(aravis, camera, quantity) for quantity in _offered(aravis, camera))


def adjust(aravis: Aravis, camera: int, name: str, value: float) -> None:
    """Set one of `settings`, and switch off its automatic control."""
    (quantity,) = (quantity for quantity in QUANTITIES if quantity.name == name)
    _take_over(aravis, camera, quantity)
    aravis.call(f"camera_set_{quantity.call}", camera, quantity.scale * value)


def hold_settings(aravis: Aravis, camera: int) -> None:
    """Switch off the automatic control of every setting."""
    for quantity in _offered(aravis, camera):
        _take_over(aravis, camera, quantity)


def modes(aravis: Aravis, camera: int) -> tuple[Mode, ...]:
    """Present size and whole sensor in each grey format, the present one first.

    Raises `CameraError` when the camera has no grey format.
    """
    present = aravis.text("camera_get_pixel_format_as_string", camera)
    formats = [name for name in _pixel_formats(aravis, camera) if name in FULL_SCALE]
    if not formats:
        raise CameraError(f"the camera must offer one of {', '.join(FULL_SCALE)}; it offers none")
    formats.sort(key=lambda name: (name != present, list(FULL_SCALE).index(name)))
    _, _, *size = region(aravis, camera)
    sizes = dict.fromkeys((tuple(size), _sensor_size(aravis, camera) or tuple(size)))  # unique, in order
    has_rate = aravis.call("camera_is_frame_rate_available", camera)
    rate = aravis.call("camera_get_frame_rate", camera) if has_rate else 0.0
    return tuple(
        Mode(
            width_px=width,
            height_px=height,
            full_scale=FULL_SCALE[name],
            frames_per_s=rate if rate > 0 else None,
            pixel_format=name,
        )
        for name in formats
        for width, height in sizes
    )


def offered(mode: Mode | None, modes: tuple[Mode, ...], name: str) -> Mode:
    """The requested mode at any rate, or the first mode when None.

    Raises `CameraError` when no mode has its size and pixel format.
    """
    if mode is None:
        return modes[0]
    for present in modes:
        if replace(mode, frames_per_s=present.frames_per_s) == present:
            return mode
    raise CameraError(f"{name} has no mode {mode.label}; it has {', '.join(present.label for present in modes)}")


def choose(aravis: Aravis, camera: int, mode: Mode) -> None:
    """Apply one of `modes`."""
    aravis.call("camera_set_pixel_format_from_string", camera, mode.pixel_format.encode())
    if region(aravis, camera)[2:] != (mode.width_px, mode.height_px):
        aravis.call("camera_set_region", camera, 0, 0, mode.width_px, mode.height_px)
    if mode.frames_per_s is not None:
        adjust(aravis, camera, "frames_per_s", mode.frames_per_s)
    aravis.call("camera_set_acquisition_mode", camera, CONTINUOUS)
    hold_settings(aravis, camera)


def region(aravis: Aravis, camera: int) -> tuple[int, int, int, int]:
    """First column, first row, columns and rows of the sensor's region."""
    positions = [ctypes.c_int() for _ in range(4)]
    aravis.call("camera_get_region", camera, *(ctypes.byref(position) for position in positions))
    first_column, first_row, columns, rows = (position.value for position in positions)
    return first_column, first_row, columns, rows


def values(offered: tuple[Setting, ...]) -> Mapping[str, float]:
    """The present values by name, for a frame."""
    return {setting.name: setting.value for setting in offered}


def _offered(aravis: Aravis, camera: int) -> list[Quantity]:
    return [quantity for quantity in QUANTITIES if aravis.call(f"camera_is_{quantity.call}_available", camera)]


def _setting(aravis: Aravis, camera: int, quantity: Quantity) -> Setting:
    try:
        low, high = aravis.pair(f"camera_get_{quantity.call}_bounds", camera, ctypes.c_double)
    except CameraError:  # some cameras give no range
        low, high = -np.inf, np.inf
    return Setting(
        name=quantity.name,
        value=aravis.call(f"camera_get_{quantity.call}", camera) / quantity.scale,
        low=low / quantity.scale,
        high=high / quantity.scale,
        unit=quantity.unit or _unit(aravis, camera, quantity),
    )


def _unit(aravis: Aravis, camera: int, quantity: Quantity) -> str:
    """Unit of the camera's value; empty for its own steps."""
    feature = {"gain": b"Gain", "black_level": b"BlackLevel"}[quantity.call]
    node = aravis.call("device_get_feature", aravis.call("camera_get_device", camera), feature)
    return aravis.text("gc_float_get_unit", node) if node and aravis.is_a(node, "gc_float") else ""


def _take_over(aravis: Aravis, camera: int, quantity: Quantity) -> None:
    if quantity.auto and aravis.call(f"camera_is_{quantity.auto}_auto_available", camera):
        aravis.call(f"camera_set_{quantity.call}_auto", camera, AUTO_OFF)


def _pixel_formats(aravis: Aravis, camera: int) -> list[str]:
    count = ctypes.c_uint()
    names = aravis.call("camera_dup_available_pixel_formats_as_strings", camera, ctypes.byref(count))
    if not names:
        return []
    texts = ctypes.cast(names, ctypes.POINTER(ctypes.c_char_p))
    formats = [(texts[index] or b"").decode(errors="replace") for index in range(count.value)]
    aravis.free(names)
    return formats


def _sensor_size(aravis: Aravis, camera: int) -> tuple[int, int] | None:
    try:
        columns, rows = aravis.pair("camera_get_sensor_size", camera, ctypes.c_int)
    except CameraError:  # some cameras give no size
        return None
    return (columns, rows) if columns > 0 and rows > 0 else None
