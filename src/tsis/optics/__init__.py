"""Light in the probe: angles and guided modes of its layers, waves in a dented guide, rays in the whole probe."""

from tsis.optics.irradiance_field import Irradiance
from tsis.optics.slab import GuidedModes, guided_modes

__all__ = ["GuidedModes", "Irradiance", "guided_modes"]
