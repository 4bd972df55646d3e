"""Large deformations: neo-Hookean bodies that slide on one another without friction and may part.

From the bottom up: the material (`neo_hookean`), bodies of it (`meshed_solid`, `elastic_body`), their shapes
(`rounded_probe`, `bodies`, `ball_mesh`), contact (`smooth_face`, `obstacle`, `sliding_contact`), their energy and the
way through the loads (`potential`, `load_path`), and the two arrangements (`probe_on_slab`, `squeezed_sphere`).
"""

from tsis.mechanics.finite_strain._load_path import State, find_first_contact, follow_load_path
from tsis.mechanics.finite_strain._meshes import FiniteResolution
from tsis.mechanics.finite_strain._press import (
    press_finite,
    press_pairs,
    press_path,
    require_ascending_forces,
    require_enough_force,
)
from tsis.mechanics.finite_strain._probe_on_slab import SPRING, ProbeOnSlab
from tsis.mechanics.finite_strain._sphere import (
    LIGHTEST,
    TOUCH,
    WIDEST_CONTACT,
    SphereOnProbe,
    SpherePress,
    SphereResolution,
    squeeze_path,
    squeeze_sphere,
)

__all__ = [
    "LIGHTEST",
    "SPRING",
    "TOUCH",
    "WIDEST_CONTACT",
    "FiniteResolution",
    "ProbeOnSlab",
    "SphereOnProbe",
    "SpherePress",
    "SphereResolution",
    "State",
    "find_first_contact",
    "follow_load_path",
    "press_finite",
    "press_pairs",
    "press_path",
    "require_ascending_forces",
    "require_enough_force",
    "squeeze_path",
    "squeeze_sphere",
]
