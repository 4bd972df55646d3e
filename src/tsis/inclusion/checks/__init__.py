"""Checks of the frames before an estimate: contact, clipping, tilt, roundness and position of the inclusion."""

from tsis.inclusion.checks._heterogeneity import FieldHarmonics, heterogeneity_evidence
from tsis.inclusion.checks._images import image_findings, require_forces_as_lit
from tsis.inclusion.checks._position import APPARENT_FRACTION, InclusionPosition, inclusion_position, position_findings
from tsis.inclusion.checks._roundness import roundness, tilt_evidence
from tsis.inclusion.checks._sectors import RINGS, SECTORS, sector_means

__all__ = [
    "APPARENT_FRACTION",
    "RINGS",
    "SECTORS",
    "FieldHarmonics",
    "InclusionPosition",
    "heterogeneity_evidence",
    "image_findings",
    "inclusion_position",
    "position_findings",
    "require_forces_as_lit",
    "roundness",
    "sector_means",
    "tilt_evidence",
]
