"""What a scan plan cannot miss, and how wide apart presses may be for an inclusion that must not be missed."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from tsis.detection.search import ROUNDING, ScanPlan
from tsis.detection.search_reach import FARTHEST_MM
from tsis.model.check import require_number, require_pair, require_type

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.detection.search_reach import Reach

SIZES_MM = (0.5, 15.0)  # between which the smallest inclusion is looked for
STEPS = 200


def widest_spacing_mm(reach_mm: float) -> float:
    """Spacing of a square grid of presses between which nothing is farther than ``reach_mm`` from one: its root 2.

    Both are in mm, the reach in [0, 500]; else `InputError` is raised.
    """
    return math.sqrt(2) * require_number("reach_mm", reach_mm, 0.0, FARTHEST_MM, hint="millimetres")


def smallest_found_mm(
    plan: ScanPlan, reach: Reach, depth_mm: float, *, sizes_mm: tuple[float, float] = SIZES_MM
) -> float | None:
    """Diameter from which on a plan cannot miss an inclusion, wherever between the presses it lies.

    "Cannot miss" means: with at least the probability that ``reach`` is for, by the nearest press alone.

    Parameters
    ----------
    plan
        Where is pressed.
    reach
        Function of diameter and depth in mm that gives the distance from the axis up to which it is found, mm.
    depth_mm
        Depth of its top.
    sizes_mm
        Diameters between which it is looked for; 200 are tried, and between two the place where it changes is found.

    Returns
    -------
    The diameter in mm; None where the plan can miss even the largest.

    Raises
    ------
    InputError
        When a value lies outside its range or the reach is no number of 0 mm or more.
    """
    require_type("plan", plan, ScanPlan)
    low, high = require_pair("sizes_mm", sizes_mm)
    require_number("the low end of sizes_mm", low, 0.1, 100.0)
    require_number("the high end of sizes_mm", high, low, 100.0)
    checked = _checked(reach)
    enough = plan.worst_distance_mm * (1 - ROUNDING)
    tried = np.linspace(low, high, STEPS)
    missed = [one for one in tried.tolist() if checked(one, depth_mm) < enough]
    if not missed:
        return low
    if missed[-1] == high:
        return None
    return _turning(lambda size: checked(size, depth_mm) >= enough, missed[-1], missed[-1] + (high - low) / (STEPS - 1))


def _turning(holds: Callable[[float], bool], below: float, above: float) -> float:
    """Where a condition that fails below and holds above begins to hold."""
    while above - below > 1e-9 * above:
        middle = (below + above) / 2
        below, above = (below, middle) if holds(middle) else (middle, above)
    return above


def _checked(reach: Reach) -> Reach:
    def asked(diameter_mm: float, depth_mm: float) -> float:
        return require_number("what reach gives", reach(diameter_mm, depth_mm), 0.0, FARTHEST_MM, hint="millimetres")

    return asked


__all__ = ["smallest_found_mm", "widest_spacing_mm"]
