"""Large deformations: neo-Hookean bodies that slide on one another without friction and may separate.

From the bottom up: material (`_neo_hookean`), meshes (`_meshes`), bodies (`_elastic_body`), contact
(`_surfaces`, `_contact`), energy and load steps (`_potential`, `_load_path`, `_continuation`), and the two arrangements
(`_probe_on_slab`, `_sphere`).
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
