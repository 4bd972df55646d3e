"""The virtual probe: mechanics, light and camera without hardware."""

from tsis.virtual.camera import VirtualCamera
from tsis.virtual.probe import VirtualProbe, nominal_calibration

__all__ = ["VirtualCamera", "VirtualProbe", "nominal_calibration"]
