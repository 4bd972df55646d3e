"""Area under the curve: how often a target with an inclusion scores above one without, ties counted half."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtri

from tsis.detection.interval import LEVEL, Interval, checked_level
from tsis.model.check import require_integer, require_number

if TYPE_CHECKING:
    from numpy.typing import NDArray

MOST_TARGETS = 10**9


def doubled_placements(scores: NDArray[Any], present: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """For each target of a class, twice the number of those of the other class that it is placed rightly against.

    In whole numbers, so that equal rankings are found to be equal. One sort replaces all pairs (Sun and Xu, IEEE Signal
    Process. Lett. 21 (2014) 1389).

    Parameters
    ----------
    scores
        Shape (targets,), finite; higher means that an inclusion is likelier.
    present
        Whether a target holds one, shape (targets,).

    Returns
    -------
    inside, outside
        Shapes (targets with,) and (targets without,); either's sum is twice the number of pairs in right order.
    """
    within, without = np.sort(scores[present]), np.sort(scores[~present])
    inside = np.searchsorted(without, scores[present], "left") + np.searchsorted(without, scores[present], "right")
    not_above = np.searchsorted(within, scores[~present], "left") + np.searchsorted(within, scores[~present], "right")
    return inside, 2 * len(within) - not_above


def area(scores: NDArray[Any], present: NDArray[np.bool_]) -> float:
    """Area under the curve of checked scores, from Mann and Whitney's count, ties counted half."""
    inside, outside = doubled_placements(scores, present)
    return int(inside.sum()) / (2 * len(inside) * len(outside))


def newcombe_interval(auc: float, present: int, absent: int, level: float = LEVEL) -> Interval:
    """Interval of an area under the curve, from the area and both numbers of targets alone.

    Newcombe's method 5 (Stat. Med. 25 (2006) 559): all areas that a score test does not reject, with the variance that
    exponential scores would have. It stays right for few targets, and for areas of 0 and 1.

    Parameters
    ----------
    auc
        Area, in [0, 1].
    present, absent
        Numbers of targets with and without an inclusion, 1 or more.
    level
        Confidence, in (0, 1).

    Raises
    ------
    InputError
        When a number is out of its range.

    Examples
    --------
    The dissertation prints an area of 0.735 for 8 targets with an inclusion and 8 without. That may be chance, 0.5:

    >>> interval = newcombe_interval(0.735, 8, 8)
    >>> [f"{end:.3f}" for end in interval], interval.holds(0.5)
    (['0.445', '0.899'], True)

    Nor does that area belong to the one point that it prints: the lines through the false positive rate 1/8 and the
    true positive rate 6/8 enclose

    >>> float(np.trapezoid([0, 6 / 8, 1], [0, 1 / 8, 1]))
    0.8125
    """
    require_number("auc", auc, 0, 1, hint="an area under the curve")
    m, n = (require_integer(name, value, 1, MOST_TARGETS) for name, value in (("present", present), ("absent", absent)))
    z = float(ndtri(0.5 + checked_level(level) / 2))
    low = _lowest_area(auc, z, m, n)
    high = 1 - _lowest_area(1 - auc, z, m, n)  # the variance is the same for an area and what it lacks to 1
    return Interval(low=low, high=max(high, auc), level=level, method="newcombe")


def _lowest_area(auc: float, z: float, m: int, n: int) -> float:
    if auc == 0:
        return 0.0
    balanced = (m + n) / 2 - 1

    def rejected(area: float) -> float:
        """Positive where the score test rejects; divided by the root of 1 - area, so that 1 is no root."""
        room = math.sqrt(1 - area)
        away = room if auc == 1 else room - (1 - auc) / room
        return away - z * math.sqrt(area * (1 + balanced * ((1 - area) / (2 - area) + area / (1 + area))) / (m * n))

    return float(brentq(rejected, 0.0, auc, xtol=1e-15))


__all__ = ["area", "doubled_placements", "newcombe_interval"]
