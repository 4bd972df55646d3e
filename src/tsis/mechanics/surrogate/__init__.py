"""Presses as polynomials over a box of inclusions and tissues."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from tsis.mechanics.surrogate import building as building
    from tsis.mechanics.surrogate import correction_building as correction_building
    from tsis.mechanics.surrogate import finite_correction as finite_correction
    from tsis.mechanics.surrogate import full_contact as full_contact
    from tsis.mechanics.surrogate import polynomial as polynomial
    from tsis.mechanics.surrogate import states as states

if not TYPE_CHECKING:  # modules load when they are first used
    __getattr__, __dir__, _ = lazy_loader.attach(
        __name__,
        submodules=["building", "correction_building", "finite_correction", "full_contact", "polynomial", "states"],
    )
