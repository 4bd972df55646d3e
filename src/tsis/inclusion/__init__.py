"""Size, depth and stiffness of an inclusion under the surface."""

from tsis.inclusion.frames import ring_edges
from tsis.inclusion.posterior import estimate
from tsis.inclusion.prior import PARAMETERS, InclusionPrior

__all__ = ["PARAMETERS", "InclusionPrior", "estimate", "ring_edges"]
