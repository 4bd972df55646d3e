"""Size, depth and stiffness of an inclusion under the surface."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from tsis.inclusion import budget as budget
    from tsis.inclusion import checks as checks
    from tsis.inclusion import comparison as comparison
    from tsis.inclusion import design as design
    from tsis.inclusion import estimation as estimation
    from tsis.inclusion import flags as flags
    from tsis.inclusion import frames as frames
    from tsis.inclusion import mobility as mobility
    from tsis.inclusion import network as network
    from tsis.inclusion import network_regressor as network_regressor
    from tsis.inclusion import network_training as network_training
    from tsis.inclusion import posterior as posterior
    from tsis.inclusion import press_track as press_track
    from tsis.inclusion import prior as prior
    from tsis.inclusion import reading as reading
    from tsis.inclusion import relative as relative
    from tsis.inclusion import shape as shape
    from tsis.inclusion import tissue as tissue
    from tsis.inclusion.estimation import estimate as estimate
    from tsis.inclusion.prior import InclusionPrior as InclusionPrior
    from tsis.inclusion.prior import load_prior as load_prior

if not TYPE_CHECKING:  # modules and names load when they are first used
    __getattr__, __dir__, _ = lazy_loader.attach(
        __name__,
        submodules=[
            "budget",
            "checks",
            "comparison",
            "design",
            "estimation",
            "flags",
            "frames",
            "mobility",
            "network",
            "network_regressor",
            "network_training",
            "posterior",
            "press_track",
            "prior",
            "reading",
            "relative",
            "shape",
            "tissue",
        ],
        submod_attrs={"prior": ["InclusionPrior", "load_prior"], "estimation": ["estimate"]},
    )
