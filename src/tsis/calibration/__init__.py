"""What makes a probe's grey levels mean something: scale, light, force, and whether a press is usable."""

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
