"""Size, depth and stiffness of an inclusion under the surface."""

from tsis.inclusion.frames import ring_edges
from tsis.inclusion.posterior import estimate
from tsis.inclusion.prior import InclusionPrior

__all__ = ["InclusionPrior", "estimate", "ring_edges"]
