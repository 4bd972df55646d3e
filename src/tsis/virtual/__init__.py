"""The virtual probe: mechanics, light and camera without hardware."""

from tsis.virtual.probe import VirtualProbe, nominal_calibration

__all__ = ["VirtualProbe", "nominal_calibration"]
