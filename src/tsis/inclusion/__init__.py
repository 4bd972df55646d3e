"""Size, depth and stiffness of an inclusion under the surface."""

from tsis.inclusion.posterior import estimate, ring_edges
from tsis.inclusion.prior import InclusionPrior

__all__ = ["InclusionPrior", "estimate", "ring_edges"]
