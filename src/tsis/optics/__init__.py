"""Light in the probe: angles and guided modes of its layers, waves in a dented guide, rays in the whole probe."""

from typing import TYPE_CHECKING

import lazy_loader

from tsis.optics._angles import (
    ERF_SLOPE,
    Acceptance,
    Fresnel,
    acceptance,
    critical_angle_deg,
    fresnel,
    layer_facing_lamp,
    real_contact,
    refraction_deg,
)
from tsis.optics._guided_modes import GuidedModes, guided_modes

__all__ = [
    "ERF_SLOPE",
    "Acceptance",
    "Fresnel",
    "GuidedModes",
    "acceptance",
    "critical_angle_deg",
    "fresnel",
    "guided_modes",
    "layer_facing_lamp",
    "real_contact",
    "refraction_deg",
]

if not TYPE_CHECKING:  # subpackages load when they are first used
    __getattr__ = lazy_loader.attach(__name__, ["irradiance", "propagation", "rays", "slab"])[0]
