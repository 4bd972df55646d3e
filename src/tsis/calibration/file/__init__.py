"""A probe's calibration as one value and one file: versioned, hashed, readable, refused when it may not serve."""

from tsis.calibration.file.content import (
    FILE_NAME,
    FORMAT,
    VERSION,
    calibration_bytes,
    identity,
    parse_calibration,
    read_calibration,
    write_calibration,
)
from tsis.calibration.file.probe_calibration import ProbeCalibration

__all__ = [
    "FILE_NAME",
    "FORMAT",
    "VERSION",
    "ProbeCalibration",
    "calibration_bytes",
    "identity",
    "parse_calibration",
    "read_calibration",
    "write_calibration",
]
