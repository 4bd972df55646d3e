"""A probe's answer to pressure: grey levels a kilopascal, and where it saturates."""

from tsis.calibration.response.fit import fit_response
from tsis.calibration.response.value import Response, Saturation

__all__ = [
    "Response",
    "Saturation",
    "fit_response",
]
