"""The specification sheet of a probe, measured."""

from tsis.calibration.specification.edge import edge_width
from tsis.calibration.specification.rate import frame_rate
from tsis.calibration.specification.sheet import Specification, SpecificationRow, specification_sheet

__all__ = [
    "Specification",
    "SpecificationRow",
    "edge_width",
    "frame_rate",
    "specification_sheet",
]
