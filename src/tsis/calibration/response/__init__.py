"""Response of a probe to pressure: grey levels per kilopascal, and saturation."""

from tsis.calibration.response._fit import fit_response
from tsis.calibration.response._light import (
    LEAST_PAD_N,
    PAD_THICKNESS_MM,
    DentLight,
    PadPresses,
    fit_dent_light,
    ring_edges_mm,
)
from tsis.calibration.response._value import PressureResponse, Saturation

__all__ = [
    "LEAST_PAD_N",
    "PAD_THICKNESS_MM",
    "DentLight",
    "PadPresses",
    "PressureResponse",
    "Saturation",
    "fit_dent_light",
    "fit_response",
    "ring_edges_mm",
]
