"""The virtual probe: mechanics, light and camera without hardware."""

from tsis.virtual.camera import VirtualCamera
from tsis.virtual.direct_contact import DirectContactRig, direct_contact_calibration
from tsis.virtual.probe import VirtualProbe, nominal_calibration

__all__ = [
    "DirectContactRig",
    "VirtualCamera",
    "VirtualProbe",
    "direct_contact_calibration",
    "nominal_calibration",
]
