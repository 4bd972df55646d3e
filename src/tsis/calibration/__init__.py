"""Calibration of a probe: scale, light, force and response; the guard that flags unusable presses."""

from typing import TYPE_CHECKING

import lazy_loader

from tsis.calibration._apply import (
    UsableCalibration,
    apply_calibration,
    parse_usable_calibration,
    read_usable_calibration,
)
from tsis.calibration._measured import MeasuredValue
from tsis.calibration._press_frames import PressFrames, load_calibration, load_frames, read_press_image

__all__ = [
    "MeasuredValue",
    "PressFrames",
    "UsableCalibration",
    "apply_calibration",
    "load_calibration",
    "load_frames",
    "parse_usable_calibration",
    "read_press_image",
    "read_usable_calibration",
]

if not TYPE_CHECKING:  # subpackages load when they are first used
    __getattr__ = lazy_loader.attach(
        __name__,
        ["file", "force", "guard", "lamps", "reference", "response", "scale", "session", "settling", "specification"],
    )[0]
