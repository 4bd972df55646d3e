"""Size, depth and stiffness of an inclusion under the surface."""

from typing import TYPE_CHECKING

import lazy_loader

from tsis.inclusion._budget import (
    PriorShift,
    UncertaintyBudget,
    prior_sensitivity,
    uncertainty_budget,
    with_prior_sensitivity,
)
from tsis.inclusion._estimate import STRAINS, estimate, stated_strain
from tsis.inclusion._frames import binary_image, depletion_per_n, ring_edges, ring_light
from tsis.inclusion._prior import PARAMETERS, InclusionPrior
from tsis.inclusion._reading import PressTables, press_tables, read_frames
from tsis.inclusion._tissue import TissueModulus, operator_time_s, prior_on_tissue, protocol_forces, tissue_modulus
from tsis.inclusion.flags import INCLUSION_FLAGS, NEARLY_CERTAIN, UNTRUSTED_FLAGS, presence_caveats

__all__ = [
    "INCLUSION_FLAGS",
    "NEARLY_CERTAIN",
    "PARAMETERS",
    "STRAINS",
    "UNTRUSTED_FLAGS",
    "InclusionPrior",
    "PressTables",
    "PriorShift",
    "TissueModulus",
    "UncertaintyBudget",
    "binary_image",
    "depletion_per_n",
    "estimate",
    "operator_time_s",
    "presence_caveats",
    "press_tables",
    "prior_on_tissue",
    "prior_sensitivity",
    "protocol_forces",
    "read_frames",
    "ring_edges",
    "ring_light",
    "stated_strain",
    "tissue_modulus",
    "uncertainty_budget",
    "with_prior_sensitivity",
]

if not TYPE_CHECKING:  # subpackages load when they are first used
    __getattr__ = lazy_loader.attach(
        __name__,
        [
            "checks",
            "design",
            "mobility",
            "network",
            "network_regressor",
            "network_training",
            "posterior",
            "relative",
            "shape",
        ],
    )[0]
