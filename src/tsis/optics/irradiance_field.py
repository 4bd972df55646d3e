"""The map of light that tracing finds; it lives among the values, because calibrations hold one."""

from tsis.model.light_map import LightMap as Irradiance

__all__ = ["Irradiance"]
