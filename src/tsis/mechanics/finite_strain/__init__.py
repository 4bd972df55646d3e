"""Large deformations: neo-Hookean bodies that slide on one another without friction and may separate.

From the bottom up: material (`_neo_hookean`), meshes (`_meshes`), bodies (`_elastic_body`), contact
(`_surfaces`, `_contact`), energy and load steps (`_potential`, `_load_path`, `_continuation`), and the two arrangements
(`_probe_on_slab`, `_sphere`).
"""

from tsis.mechanics.finite_strain._continuation import PressContinuation, SlabPress, SolvedPress
from tsis.mechanics.finite_strain._load_path import State, find_first_contact, follow_load_path
from tsis.mechanics.finite_strain._meshes import NARROW, WIDE_LAYERS, FiniteResolution, slab_lines
from tsis.mechanics.finite_strain._press import (
    PressSeries,
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
    "NARROW",
    "SPRING",
    "TOUCH",
    "WIDEST_CONTACT",
    "WIDE_LAYERS",
    "FiniteResolution",
    "PressContinuation",
    "PressSeries",
    "ProbeOnSlab",
    "SlabPress",
    "SolvedPress",
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
    "slab_lines",
    "squeeze_path",
    "squeeze_sphere",
]
