"""Presses at small strain: layers condensed onto the face, and unilateral contact."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from tsis.mechanics.small_strain import linear_press as linear_press
    from tsis.mechanics.small_strain import relaxation as relaxation
    from tsis.mechanics.small_strain import rigid_ball as rigid_ball
    from tsis.mechanics.small_strain import slab as slab
    from tsis.mechanics.small_strain import unilateral as unilateral

if not TYPE_CHECKING:  # modules load when they are first used
    __getattr__, __dir__, _ = lazy_loader.attach(
        __name__, submodules=["linear_press", "relaxation", "rigid_ball", "slab", "unilateral"]
    )
