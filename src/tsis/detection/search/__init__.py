"""Where to press to search an area, and what such a plan cannot miss."""

from tsis.detection.search._plan import ScanPlan, scan_plan, smallest_found_mm, widest_plan, widest_spacing_mm
from tsis.detection.search._range import ReachTable, measured_reach, reach_of_trials, read_reach

__all__ = [
    "ReachTable",
    "ScanPlan",
    "measured_reach",
    "reach_of_trials",
    "read_reach",
    "scan_plan",
    "smallest_found_mm",
    "widest_plan",
    "widest_spacing_mm",
]
