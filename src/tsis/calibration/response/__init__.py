"""Response of a probe to pressure: grey levels per kilopascal, and saturation."""

from tsis.calibration.response._fit import fit_response
from tsis.calibration.response._value import PressureResponse, Saturation

__all__ = ["PressureResponse", "Saturation", "fit_response"]
