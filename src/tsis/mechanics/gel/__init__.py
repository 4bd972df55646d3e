"""A gel layer bonded to a rigid backing: pressure, force and shear from the movement of its face."""

from tsis.mechanics.gel._contact import GelGrid, LayerCompliance, LayerContact, layer_compliance, layer_contact
from tsis.mechanics.gel._force import (
    DepthErrors,
    ForceScale,
    GelForce,
    GelPressure,
    gel_force,
    gel_force_scale,
    pressure_from_depth,
)
from tsis.mechanics.gel._shear import GelShear, gel_shear

__all__ = [
    "DepthErrors",
    "ForceScale",
    "GelForce",
    "GelGrid",
    "GelPressure",
    "GelShear",
    "LayerCompliance",
    "LayerContact",
    "gel_force",
    "gel_force_scale",
    "gel_shear",
    "layer_compliance",
    "layer_contact",
    "pressure_from_depth",
]
