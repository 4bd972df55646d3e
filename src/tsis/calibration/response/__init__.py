"""A probe's answer to pressure: grey levels a kilopascal, and where it saturates."""

from tsis.calibration.response._fit import fit_response
from tsis.calibration.response._value import PressureResponse, Saturation

__all__ = ["PressureResponse", "Saturation", "fit_response"]
