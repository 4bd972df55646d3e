"""The light on the face of the probe from inside, as a smooth function of position, displacement and slope."""

from tsis.optics.irradiance._field import Irradiance, leaving_light
from tsis.optics.irradiance._trace import irradiance

__all__ = ["Irradiance", "irradiance", "leaving_light"]
