"""Light in the probe: angles and guided modes of its layers, waves in a dented guide, rays in the whole probe."""

from tsis.optics.irradiance_field import Irradiance
from tsis.optics.propagation import Dent, Propagation, ThinGuide, propagate, thin_guide
from tsis.optics.slab import GuidedModes, guided_modes

__all__ = ["Dent", "GuidedModes", "Irradiance", "Propagation", "ThinGuide", "guided_modes", "propagate", "thin_guide"]
