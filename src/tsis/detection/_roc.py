"""Receiver operating characteristic: true and false positive rates as functions of the threshold, and the area below.

The area is how often a target with an inclusion scores above one without, ties counted half.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from tsis.detection._bootstrap import DRAWS, bootstrap_auc
from tsis.detection._counts import Counts
from tsis.detection._inputs import LEVEL, Interval, booleans, both_classes, checked_level, choice, scored
from tsis.errors import InputError
from tsis.model import freeze_arrays, require_array, require_integer, require_number

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray


MOST_TARGETS = 10**9


def doubled_placements(scores: NDArray[Any], present: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Twice the number of correctly ranked pairs of each target with the other class, for targets with and without.

    Whole numbers make equal rankings exactly equal. One sort replaces all pairs (Sun and Xu, IEEE Signal Process. Lett.
    21 (2014) 1389).
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
    """Interval of an area under the curve, from the area and both numbers of targets.

    Newcombe's method 5 (Stat. Med. 25 (2006) 559): all areas that a score test does not reject, with the variance of
    exponential scores. It is valid for few targets, and for areas of 0 and 1. Raises `InputError` when a number is out
    of its range.

    Parameters
    ----------
    auc
        Area, in [0, 1].
    present, absent
        Numbers of targets with and without an inclusion, 1 or more.
    level
        Confidence, in (0, 1).

    Examples
    --------
    The dissertation prints an area of 0.735 for 8 targets with an inclusion and 8 without. That may be chance, 0.5:

    >>> interval = newcombe_interval(0.735, 8, 8)
    >>> [f"{end:.3f}" for end in interval], interval.holds(0.5)
    (['0.445', '0.899'], True)

    The printed area also contradicts the printed point: the lines through the false positive rate 1/8 and the true
    positive rate 6/8 enclose

    >>> float(np.trapezoid([0, 6 / 8, 1], [0, 1 / 8, 1]))
    0.8125
    """
    require_number("auc", auc, 0, 1, hint="an area under the curve")
    m, n = (require_integer(name, value, 1, MOST_TARGETS) for name, value in (("present", present), ("absent", absent)))
    z = float(scipy.special.ndtri(0.5 + checked_level(level) / 2))
    low = _lowest_area(auc, z, m, n)
    high = 1 - _lowest_area(1 - auc, z, m, n)  # the variance is symmetric under area -> 1 - area
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

    return float(scipy.optimize.brentq(rejected, 0.0, auc, xtol=1e-15))


FROM_TARGETS = 30  # least number of targets per class for the normal approximation
FROM_ENDS = 5  # least product of smaller class and distance of the area from 0 and 1: below, coverage is too low


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AucCovariance:
    """Areas of several methods on the same targets, with their covariance.

    Attributes
    ----------
    auc
        Areas under the curves, shape (methods,).
    covariance
        Covariance of their errors, shape (methods, methods).
    present, absent
        Numbers of targets with and without an inclusion.
    """

    auc: NDArray[np.float64]
    covariance: NDArray[np.float64]
    present: int
    absent: int

    def __post_init__(self) -> None:
        freeze_arrays(self, "auc", "covariance", dtype=float)


def auc_covariance(scores: ArrayLike, present: ArrayLike) -> AucCovariance:
    """Areas under the curves of several methods, and their covariance.

    Raises `InputError` when the scores are not finite or their shape does not fit, or a class has fewer than two
    targets.

    Parameters
    ----------
    scores
        Scores of each method for the same targets, shape (methods, targets); higher speaks for an inclusion.
    present
        Whether a target holds an inclusion, booleans of shape (targets,); at least two targets of each kind.

    Examples
    --------
    >>> found = auc_covariance([[1, 4, 2, 5], [2, 1, 3, 4]], [False, True, False, True])
    >>> found.auc.tolist()
    [1.0, 0.5]
    """
    values, truth = require_array("scores", scores, ndim=2), booleans("present", present)
    if values.shape[1] != len(truth):
        raise InputError(f"scores must have one column a target, {len(truth)} in all; got shape {values.shape}")
    m, n = both_classes(truth, least=2, needed_by="a variance")
    inside, outside = _placed(values, truth)
    return AucCovariance(
        auc=inside.sum(axis=1) / (2 * m * n), covariance=_covariance(inside, outside), present=m, absent=n
    )


def delong_interval(scores: NDArray[np.float64], present: NDArray[np.bool_], level: float = LEVEL) -> Interval:
    """DeLong's interval of one area, cut to [0, 1].

    Raises `InputError` when a class has fewer than two targets, or the variance is estimated as 0, as it is for areas
    of 0 and 1.

    Examples
    --------
    >>> interval = delong_interval(np.array([1.0, 3.0, 2.0, 4.0]), np.array([False, False, True, True]), 0.5)
    >>> [round(end, 3) for end in interval]
    [0.512, 0.988]
    """
    z = float(scipy.special.ndtri(0.5 + checked_level(level) / 2))
    result = auc_covariance(np.atleast_2d(scores), present)
    auc, variance = float(result.auc[0]), float(result.covariance[0, 0])
    if variance == 0:
        raise InputError(
            f"method must not be delong where its variance is 0, as for an area under the curve of {auc:g}: "
            "take newcombe, which holds there"
        )
    half = z * math.sqrt(variance)
    return Interval(low=max(auc - half, 0.0), high=min(auc + half, 1.0), level=level, method="delong")


def difference_variance(scores: NDArray[np.float64], present: NDArray[np.bool_]) -> float:
    """Variance of the difference of two areas, from scores of shape (2, targets); exactly 0 where nothing varies."""
    inside, outside = _placed(scores, present)
    return float(_covariance(inside[:1] - inside[1:], outside[:1] - outside[1:])[0, 0])


def _placed(scores: NDArray[np.float64], present: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    pairs = [doubled_placements(row, present) for row in scores]
    return np.stack([inside for inside, _ in pairs]), np.stack([outside for _, outside in pairs])


def _covariance(inside: NDArray[np.int64], outside: NDArray[np.int64]) -> NDArray[np.float64]:
    """From doubled placements of shapes (methods, m) and (methods, n); whole numbers leave exact zeros."""
    m, n = inside.shape[1], outside.shape[1]
    within = np.atleast_2d(np.cov(inside - inside[:, :1])) / (4 * n**2)
    without = np.atleast_2d(np.cov(outside - outside[:, :1])) / (4 * m**2)
    both: NDArray[np.float64] = within / m + without / n
    return both


def is_normal(auc: float, present: int, absent: int) -> bool:
    """Whether DeLong's interval of an area covers as it says, as measured by ``benchmarks/detection_intervals.py``.

    Examples
    --------
    >>> is_normal(0.8, 40, 40), is_normal(0.8, 8, 8), is_normal(0.98, 40, 40)
    (True, False, False)
    """
    smaller = min(present, absent)
    return smaller >= FROM_TARGETS and smaller * min(auc, 1 - auc) >= FROM_ENDS


METHODS = ("delong", "newcombe", "bootstrap")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Roc:
    """A step curve; a target is decided as an inclusion where its score is at least the threshold.

    Raises `InputError` when a score is not finite, the truth is not boolean, the lengths differ, or a class is missing.

    Parameters
    ----------
    scores
        Shape (targets,), finite; higher means that an inclusion is likelier.
    present
        Whether a target holds an inclusion, booleans of shape (targets,), both kinds.

    Attributes
    ----------
    thresholds
        Infinity, where no target is decided as an inclusion, then the distinct scores, falling.
    true_positive_rate, false_positive_rate
        At each threshold, rising from 0 to 1.
    true_positives, false_positives
        Numbers of targets with and without an inclusion that are decided as one at each threshold.
    """

    scores: NDArray[np.float64]
    present: NDArray[np.bool]
    thresholds: NDArray[np.float64] = field(init=False)
    true_positives: NDArray[np.int64] = field(init=False)
    false_positives: NDArray[np.int64] = field(init=False)

    def __post_init__(self) -> None:
        scores, present = scored(self.scores, self.present)
        both_classes(present, needed_by="a curve")
        falling, position = np.unique(-scores, return_inverse=True)
        inside = np.bincount(position[present], minlength=len(falling))
        outside = np.bincount(position[~present], minlength=len(falling))
        results = {
            "scores": scores,
            "present": present,
            "thresholds": np.concatenate([[math.inf], -falling]),
            "true_positives": np.concatenate([[0], np.cumsum(inside)]),
            "false_positives": np.concatenate([[0], np.cumsum(outside)]),
        }
        for name, value in results.items():
            value.flags.writeable = False
            object.__setattr__(self, name, value)

    @property
    def targets(self) -> int:
        """Number of targets with an inclusion."""
        return int(self.true_positives[-1])

    @property
    def blanks(self) -> int:
        """Number of targets without one."""
        return int(self.false_positives[-1])

    @property
    def true_positive_rate(self) -> NDArray[np.float64]:
        """Sensitivity at each threshold."""
        rate: NDArray[np.float64] = self.true_positives / self.targets
        return rate

    @property
    def false_positive_rate(self) -> NDArray[np.float64]:
        """One less specificity at each threshold."""
        rate: NDArray[np.float64] = self.false_positives / self.blanks
        return rate

    @property
    def auc(self) -> float:
        """Area under the curve, in [0, 1]: how often a target with an inclusion scores above one without, ties half."""
        return area(self.scores, self.present)

    def counts(self, index: int) -> Counts:
        """Decisions at the threshold of that index, counted; `InputError` when there is no such threshold.

        Parameters
        ----------
        index
            Into ``thresholds``, from 0.
        """
        index = require_integer("index", index, 0, len(self.thresholds) - 1)
        result, false = int(self.true_positives[index]), int(self.false_positives[index])
        return Counts(
            true_positives=result,
            false_positives=false,
            true_negatives=self.blanks - false,
            false_negatives=self.targets - result,
        )

    def auc_interval(
        self,
        level: float = LEVEL,
        method: str | None = None,
        *,
        rng: np.random.Generator | None = None,
        draws: int = DRAWS,
        progress: Callable[[int, int], None] | None = None,
    ) -> Interval:
        """Interval of the area under the curve.

        Raises `InputError` when the level is no probability, the method unknown or without a spread here, or ``rng``
        missing.

        Parameters
        ----------
        level
            Confidence, in (0, 1).
        method
            ``"delong"``, which needs many targets, and whose variance vanishes for areas of 0 and 1; ``"newcombe"``
            (2006, method 5), which is valid for few and for areas near 1; ``"bootstrap"``, which needs ``rng``. None is
            DeLong's where both classes have 30 targets or more, and the number of the smaller times the area's distance
            from 0 and from 1 is at least 5; else Newcombe's. The interval's ``method`` names it.
        rng, draws, progress
            For the bootstrap: random generator, number of draws, and a function called with (done, total).
        """
        if method is None:
            method = "delong" if is_normal(self.auc, self.targets, self.blanks) else "newcombe"
        if choice("method", method, METHODS) == "delong":
            return delong_interval(self.scores, self.present, level)
        if method == "newcombe":
            return newcombe_interval(self.auc, self.targets, self.blanks, level)
        if rng is None:
            raise InputError("rng must be given for the bootstrap; got None: give numpy.random.default_rng(seed)")
        return bootstrap_auc(self.scores, self.present, rng=rng, level=level, draws=draws, progress=progress)


def roc(scores: ArrayLike, present: ArrayLike) -> Roc:
    """Curve of a detector.

    Parameters
    ----------
    scores, present
        As for `Roc`, which raises `InputError` for invalid ones.

    Examples
    --------
    >>> curve = roc([0.1, 0.4, 0.35, 0.8], [False, False, True, True])
    >>> curve.auc, curve.auc_interval().method
    (0.75, 'newcombe')
    >>> [f"{end:.2f}" for end in curve.auc_interval()]
    ['0.23', '0.97']
    """
    return Roc(scores=scores, present=present)  # type: ignore[arg-type]  # the value copies and checks them
