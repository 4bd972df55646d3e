"""Presses in three dimensions: inclusions off the axis, ellipsoids, several at once (extra ``fem3d``)."""

from tsis.mechanics.solid._mesh import SolidResolution
from tsis.mechanics.solid._press import press_solid

__all__ = ["SolidResolution", "press_solid"]
