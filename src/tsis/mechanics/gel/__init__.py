"""A gel layer bonded to a rigid backing: pressure, force and shear from the movement of its face."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from tsis.mechanics.gel import contact as contact
    from tsis.mechanics.gel import force as force
    from tsis.mechanics.gel import shear as shear

if not TYPE_CHECKING:  # modules load when they are first used
    __getattr__, __dir__, _ = lazy_loader.attach(__name__, submodules=["contact", "force", "shear"])
