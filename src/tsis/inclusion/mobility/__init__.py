"""Mobility: displacement of the light over a sequence of frames, (6.14)."""

from tsis.inclusion.mobility._track import Mobility, mobility

__all__ = ["Mobility", "mobility"]
