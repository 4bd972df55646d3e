"""Posterior of an inclusion: forward model of ring profiles, likelihood, and the grid that explores it."""

from tsis.inclusion.posterior._exploration import InclusionPosterior, explore_inclusion
from tsis.inclusion.posterior._forward import NUISANCES, SHARED, THICKNESS, TISSUE, ForwardModel
from tsis.inclusion.posterior._heterogeneity import (
    HARMONICS,
    LENGTHS_MM,
    FieldTable,
    Heterogeneity,
    SuperficialLayer,
    build_field_table,
    heterogeneity,
)
from tsis.inclusion.posterior._likelihood import (
    ErrorSources,
    InclusionLikelihood,
    Profiles,
    least_sd,
)
from tsis.inclusion.posterior._rings import (
    FARTHEST,
    SHIFTED,
    RingShading,
    ShadingUncertainty,
    off_axis_profile,
    ring_correction,
    ring_correlation,
    ring_means,
    ring_responses,
)

__all__ = [
    "FARTHEST",
    "HARMONICS",
    "LENGTHS_MM",
    "NUISANCES",
    "SHARED",
    "SHIFTED",
    "THICKNESS",
    "TISSUE",
    "ErrorSources",
    "FieldTable",
    "ForwardModel",
    "Heterogeneity",
    "InclusionLikelihood",
    "InclusionPosterior",
    "Profiles",
    "RingShading",
    "ShadingUncertainty",
    "SuperficialLayer",
    "build_field_table",
    "explore_inclusion",
    "heterogeneity",
    "least_sd",
    "off_axis_profile",
    "ring_correction",
    "ring_correlation",
    "ring_means",
    "ring_responses",
]
