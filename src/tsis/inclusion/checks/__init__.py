"""What the frames themselves say against an estimate: no contact, clipping, tilt, no round inclusion, off the axis."""

from tsis.inclusion.checks._images import image_findings
from tsis.inclusion.checks._place import SEEN, InclusionPosition, inclusion_position
from tsis.inclusion.checks._roundness import roundness, tilt_evidence
from tsis.inclusion.checks._sectors import RINGS, SECTORS, sector_means

__all__ = [
    "RINGS",
    "SECTORS",
    "SEEN",
    "InclusionPosition",
    "image_findings",
    "inclusion_position",
    "roundness",
    "sector_means",
    "tilt_evidence",
]
