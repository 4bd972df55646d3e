"""A probe's calibration as one value and one file: versioned, hashed, readable, refused when it may not serve."""

from tsis.calibration.file.content import (
    CALIBRATION_FILE,
    CALIBRATION_FORMAT,
    CALIBRATION_VERSION,
    calibration_bytes,
    calibration_sha256,
    parse_calibration,
    read_calibration,
    write_calibration,
)
from tsis.calibration.file.probe_calibration import ProbeCalibration

__all__ = [
    "CALIBRATION_FILE",
    "CALIBRATION_FORMAT",
    "CALIBRATION_VERSION",
    "ProbeCalibration",
    "calibration_bytes",
    "calibration_sha256",
    "parse_calibration",
    "read_calibration",
    "write_calibration",
]
