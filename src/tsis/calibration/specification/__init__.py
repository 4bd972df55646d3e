"""The measured specification sheet of a probe."""

from tsis.calibration.specification._edge import edge_width
from tsis.calibration.specification._sheet import Specification, SpecificationRow, frame_rate, specification_sheet

__all__ = ["Specification", "SpecificationRow", "edge_width", "frame_rate", "specification_sheet"]
