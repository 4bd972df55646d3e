"""Plans of presses that search an area, and the inclusions that a plan cannot miss."""

from tsis.detection.search._plan import ScanPlan, scan_plan, smallest_found_mm, widest_plan, widest_spacing_mm
from tsis.detection.search._range import (
    DetectionRangeTable,
    detection_range_of_trials,
    measured_detection_range,
    read_detection_range,
)

__all__ = [
    "DetectionRangeTable",
    "ScanPlan",
    "detection_range_of_trials",
    "measured_detection_range",
    "read_detection_range",
    "scan_plan",
    "smallest_found_mm",
    "widest_plan",
    "widest_spacing_mm",
]
