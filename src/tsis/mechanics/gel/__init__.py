"""A gel layer bonded to a rigid backing: pressure, force and shear from the movement of its face."""

from tsis.mechanics.gel._contact import GelGrid, LayerCompliance, LayerContact, layer_compliance, layer_contact
from tsis.mechanics.gel._force import DepthErrors, ForceScale, GelForce, gel_force, gel_force_scale
from tsis.mechanics.gel._pressure import GelPressure, pressure_from_depth

__all__ = [
    "DepthErrors",
    "ForceScale",
    "GelForce",
    "GelGrid",
    "GelPressure",
    "LayerCompliance",
    "LayerContact",
    "gel_force",
    "gel_force_scale",
    "layer_compliance",
    "layer_contact",
    "pressure_from_depth",
]
