"""FIXME."""

from tsis.optics.slab._layers import SlabLayers, thickness_factor

__all__ = ["SlabLayers", "thickness_factor"]
