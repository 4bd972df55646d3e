"""What a press does to probe and tissue: closed forms, finite elements, and a fast surrogate."""

from tsis.mechanics.bodies import Resolution
from tsis.mechanics.covered_surrogate import (
    FullContactParts,
    FullContactProfiles,
    FullContactSurrogate,
    build_full_contact_surrogate,
)
from tsis.mechanics.finite_strain.bodies import FiniteResolution
from tsis.mechanics.finite_strain.pressing import press_pairs, press_path
from tsis.mechanics.finite_strain.squeezed_sphere import SpherePress, SphereResolution, squeeze_path, squeeze_sphere
from tsis.mechanics.indentation import Indentation, indent
from tsis.mechanics.pressing import press
from tsis.mechanics.solid import press_solid
from tsis.mechanics.solid_mesh import SolidResolution
from tsis.mechanics.surrogate import Box, Degrees, PressSurrogate, Surrogate, contrast_factor
from tsis.mechanics.surrogate_build import build_surrogate
from tsis.mechanics.viscoelastic import RelaxingPress, relaxing_press, settling_time_s

__all__ = [
    "Box",
    "Degrees",
    "FiniteResolution",
    "FullContactParts",
    "FullContactProfiles",
    "FullContactSurrogate",
    "Indentation",
    "PressSurrogate",
    "RelaxingPress",
    "Resolution",
    "SolidResolution",
    "SpherePress",
    "SphereResolution",
    "Surrogate",
    "build_full_contact_surrogate",
    "build_surrogate",
    "contrast_factor",
    "indent",
    "press",
    "press_pairs",
    "press_path",
    "press_solid",
    "relaxing_press",
    "settling_time_s",
    "squeeze_path",
    "squeeze_sphere",
]
