"""The camera reference: dark frame, untouched probe, flat field and noise, and the correction of later frames."""

from tsis.calibration.reference._make import PhotonTransfer, make_reference, photon_transfer
from tsis.calibration.reference._value import CameraReference

__all__ = ["CameraReference", "PhotonTransfer", "make_reference", "photon_transfer"]
