"""Posterior of an inclusion: forward model of ring profiles, likelihood, and the grid that explores it."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from tsis.inclusion.posterior import exploration as exploration
    from tsis.inclusion.posterior import forward as forward
    from tsis.inclusion.posterior import grid as grid
    from tsis.inclusion.posterior import likelihood as likelihood
    from tsis.inclusion.posterior import rings as rings
    from tsis.inclusion.posterior import uneven_tissue as uneven_tissue

if not TYPE_CHECKING:  # modules load when they are first used
    __getattr__, __dir__, _ = lazy_loader.attach(
        __name__, submodules=["exploration", "forward", "grid", "likelihood", "rings", "uneven_tissue"]
    )
