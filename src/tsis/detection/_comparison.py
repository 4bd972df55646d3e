"""Compare the areas under the curve of two methods on the same targets."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.detection._bootstrap import DRAWS, drawn_areas, percentiles
from tsis.detection._inputs import LEVEL, Interval, both_classes, checked_level, scored
from tsis.detection._roc import area, difference_variance

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray


NO_SPREAD = "the difference does not vary from target to target, so that neither interval nor test exists"


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Two methods on the same targets.

    Attributes
    ----------
    first_auc, second_auc
        Their areas under the curve.
    difference
        First less second.
    method
        ``"delong"`` or ``"bootstrap"``.
    standard_error
        Of the difference; 0 where it does not vary.
    interval
        Of the difference; None where it does not vary.
    z, p
        Difference in standard errors, and its two-sided p-value; None where it does not vary.
    remark
        Reason of a missing interval and test, else empty.
    """

    first_auc: float
    second_auc: float
    difference: float
    method: str
    standard_error: float
    interval: Interval | None
    z: float | None
    p: float | None
    remark: str = ""


def compare_detectors(first: ArrayLike, second: ArrayLike, present: ArrayLike, *, level: float = LEVEL) -> Comparison:
    """Compare two methods by DeLong's paired test.

    The test assumes a normal distribution: below some 30 targets of each kind it is approximate. Raises `InputError`
    when the input is bad, or a class has fewer than two targets.

    Parameters
    ----------
    first, second
        Scores of two methods for the same targets, shape (targets,); higher means that an inclusion is likelier.
    present
        Whether a target holds an inclusion, booleans of shape (targets,); at least two targets of each kind.
    level
        Confidence of the interval, in (0, 1).

    Examples
    --------
    >>> truth = [False, False, False, True, True, True]
    >>> found = compare_detectors([1, 2, 4, 3, 5, 6], [3, 1, 5, 2, 4, 6], truth)
    >>> round(found.difference, 3), round(found.z, 3)
    (0.222, 1.414)
    """
    scores, truth = _pair(first, second, present)
    both_classes(truth, least=2, needed_by="a paired test")
    half = float(scipy.special.ndtri(0.5 + checked_level(level) / 2))
    spread = math.sqrt(difference_variance(scores, truth))
    difference = area(scores[0], truth) - area(scores[1], truth)
    low, high = max(difference - half * spread, -1.0), min(difference + half * spread, 1.0)
    return _compared(scores, truth, spread, Interval(low=low, high=high, level=level, method="delong"))


def bootstrap_compare_detectors(
    first: ArrayLike,
    second: ArrayLike,
    present: ArrayLike,
    *,
    rng: np.random.Generator,
    level: float = LEVEL,
    draws: int = DRAWS,
    progress: Callable[[int, int], None] | None = None,
) -> Comparison:
    """Compare two methods by the stratified bootstrap, with the same resampled targets for both.

    The interval is that of percentiles; the test divides the difference by the standard deviation of the draws. Raises
    `InputError` when the input is bad, or a class is missing.

    Parameters
    ----------
    first, second, present
        As for `compare_detectors`; one target of each kind is enough.
    rng, level, draws, progress
        As for `bootstrap_auc`.

    Examples
    --------
    >>> truth = [False, False, False, True, True, True]
    >>> same = bootstrap_compare_detectors([1, 2, 4, 3, 5, 6], [1, 2, 4, 3, 5, 6], truth, rng=np.random.default_rng(0))
    >>> same.difference, same.p, same.remark[:39]
    (0.0, None, 'the difference does not vary from targe')
    """
    scores, truth = _pair(first, second, present)
    checked_level(level)
    areas = drawn_areas(scores, truth, rng=rng, draws=draws, progress=progress)
    drawn = areas[:, 0] - areas[:, 1]
    spread = float(drawn.std(ddof=1)) if np.ptp(drawn) > 0 else 0.0
    return _compared(scores, truth, spread, percentiles(drawn, level))


def _pair(first: ArrayLike, second: ArrayLike, present: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Scores of both methods, shape (2, targets), and the truth."""
    (first, truth), (second, _) = scored(first, present, name="first"), scored(second, present, name="second")
    return np.stack([first, second]), truth


def _compared(scores: NDArray[np.float64], truth: NDArray[np.bool_], spread: float, interval: Interval) -> Comparison:
    first, second = (area(row, truth) for row in scores)
    varies = spread > 0
    z = (first - second) / spread if varies else None
    return Comparison(
        first_auc=first,
        second_auc=second,
        difference=first - second,
        method=interval.method,
        standard_error=spread,
        interval=interval if varies else None,
        z=z,
        p=float(scipy.special.erfc(abs(z) / math.sqrt(2))) if z is not None else None,
        remark="" if varies else NO_SPREAD,
    )
