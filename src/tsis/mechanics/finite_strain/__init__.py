"""Large deformations: neo-Hookean bodies that slide on one another without friction and may separate.

From the bottom up: the material (`neo_hookean`), meshes welded of patches (`patches`), contact that slides
(`sliding`), energy and load steps (`equilibrium`), and the two arrangements (`probe_on_slab`, `soft_sphere`).
"""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from tsis.mechanics.finite_strain import equilibrium as equilibrium
    from tsis.mechanics.finite_strain import neo_hookean as neo_hookean
    from tsis.mechanics.finite_strain import neo_hookean_press as neo_hookean_press
    from tsis.mechanics.finite_strain import patches as patches
    from tsis.mechanics.finite_strain import probe_on_slab as probe_on_slab
    from tsis.mechanics.finite_strain import sliding as sliding
    from tsis.mechanics.finite_strain import soft_sphere as soft_sphere

if not TYPE_CHECKING:  # modules load when they are first used
    __getattr__, __dir__, _ = lazy_loader.attach(
        __name__,
        submodules=[
            "equilibrium",
            "neo_hookean",
            "neo_hookean_press",
            "patches",
            "probe_on_slab",
            "sliding",
            "soft_sphere",
        ],
    )
