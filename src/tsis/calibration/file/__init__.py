"""The calibration of a probe as one value and one file: versioned, hashed and checked before use."""

from tsis.calibration.file._content import (
    CALIBRATION_FORMAT,
    CALIBRATION_VERSION,
    LARGEST_BYTES,
    calibration_bytes,
    calibration_sha256,
    document_sha256,
    parse_calibration,
    read_calibration,
    read_handwritten_calibration,
    write_calibration,
)
from tsis.calibration.file._value import SETTING_TOLERANCE, ProbeCalibration, require_name, require_time

__all__ = [
    "CALIBRATION_FORMAT",
    "CALIBRATION_VERSION",
    "LARGEST_BYTES",
    "SETTING_TOLERANCE",
    "ProbeCalibration",
    "calibration_bytes",
    "calibration_sha256",
    "document_sha256",
    "parse_calibration",
    "read_calibration",
    "read_handwritten_calibration",
    "require_name",
    "require_time",
    "write_calibration",
]
