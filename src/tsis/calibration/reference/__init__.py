"""What a camera sees without contact, and what later frames are corrected with."""

from tsis.calibration.reference.making import make_reference
from tsis.calibration.reference.noise import PhotonTransfer, photon_transfer
from tsis.calibration.reference.value import CameraReference

__all__ = [
    "CameraReference",
    "PhotonTransfer",
    "make_reference",
    "photon_transfer",
]
