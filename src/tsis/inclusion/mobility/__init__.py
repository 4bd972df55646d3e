"""FIXME."""

from tsis.inclusion.mobility._track import Mobility, mobility

__all__ = ["Mobility", "mobility"]
