"""FIXME."""

from tsis.optics.irradiance._field import Irradiance, leaving_light
from tsis.optics.irradiance._trace import irradiance

__all__ = ["Irradiance", "irradiance", "leaving_light"]
