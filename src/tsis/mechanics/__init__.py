"""Deformation of probe and tissue under a press."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from tsis.mechanics import bench_tests as bench_tests
    from tsis.mechanics import closed_forms as closed_forms
    from tsis.mechanics import finite_strain as finite_strain
    from tsis.mechanics import gel as gel
    from tsis.mechanics import layer_indentation as layer_indentation
    from tsis.mechanics import lump_kernel as lump_kernel
    from tsis.mechanics import mesh as mesh
    from tsis.mechanics import pressing as pressing
    from tsis.mechanics import small_strain as small_strain
    from tsis.mechanics import solid as solid
    from tsis.mechanics import surrogate as surrogate
    from tsis.mechanics import tissue_field as tissue_field
    from tsis.mechanics.bench_tests import indentation_modulus as indentation_modulus
    from tsis.mechanics.pressing import press as press

if not TYPE_CHECKING:  # modules and names load when they are first used
    __getattr__, __dir__, _ = lazy_loader.attach(
        __name__,
        submodules=[
            "bench_tests",
            "closed_forms",
            "finite_strain",
            "gel",
            "layer_indentation",
            "lump_kernel",
            "mesh",
            "pressing",
            "small_strain",
            "solid",
            "surrogate",
            "tissue_field",
        ],
        submod_attrs={"bench_tests": ["indentation_modulus"], "pressing": ["press"]},
    )
