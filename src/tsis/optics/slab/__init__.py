"""Waves in a slab of layers: phase, field and a slow reference of its guided modes."""

from tsis.optics.slab._field import SlabField, SlabLayers, mode_field, nearly_degenerate, thickness_factor
from tsis.optics.slab._phase import mode_roots

__all__ = ["SlabField", "SlabLayers", "mode_field", "mode_roots", "nearly_degenerate", "thickness_factor"]
