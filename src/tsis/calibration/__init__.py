"""Calibration of a probe: scale, light, force and response; the guard that flags unusable presses."""

from tsis.calibration._apply import (
    UsableCalibration,
    apply_calibration,
    parse_usable_calibration,
    read_usable_calibration,
)
from tsis.calibration._measured import MeasuredValue

__all__ = [
    "MeasuredValue",
    "UsableCalibration",
    "apply_calibration",
    "parse_usable_calibration",
    "read_usable_calibration",
]
