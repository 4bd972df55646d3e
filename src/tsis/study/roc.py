"""Receiver operating characteristic, and the area below.

The area is how often a target with an inclusion scores above one without, ties counted half. Methods are compared on
the same targets. A threshold is chosen by a purpose; a point is optimistic on the targets on which it was chosen, and
`held_out_counts` chooses on other targets than it counts.

Curves count whole numbers, so that ties stay ties; scikit-learn gives the same rates and areas, but no interval. The
bootstrap draws the same targets of each class for all methods, in memory that does not grow with the draws.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from tsis.errors import InputError
from tsis.model.require import freeze_arrays, require_array, require_integer, require_number
from tsis.study.proportions import LEVEL, Counts, Interval, booleans, both_classes, checked_level, choice, scored

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import ArrayLike, NDArray

DRAWS = 2000
MOST_DRAWS = 10**7
AT_ONCE = 2**20  # numbers of one batch of draws
MOST_TARGETS = 10**9
FROM_TARGETS = 30  # least number of targets per class for the normal approximation
FROM_ENDS = 5  # least product of smaller class and distance of the area from 0 and 1: below, coverage is too low
METHODS = ("delong", "newcombe", "bootstrap")
NO_SPREAD = "the difference does not vary from target to target, so that neither interval nor test exists"
ROUNDING = 1e-9  # of a requested rate times the number of targets: 0.7 of 10 are 7


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Roc:
    """A step curve; a target is decided as an inclusion where its score is at least the threshold.

    Raises `InputError` when a score is not finite, the truth is not boolean, the lengths differ, or a class is missing.
    """

    scores: NDArray[np.float64]  #: shape (targets,), finite; higher means that an inclusion is likelier
    present: NDArray[np.bool]  #: whether a target holds an inclusion, booleans of shape (targets,), both kinds
    #: infinity, where no target is decided as an inclusion, then the distinct scores, falling
    thresholds: NDArray[np.float64] = field(init=False)
    #: true_positives, false_positives: targets with and without an inclusion that are decided as one at each threshold
    true_positives: NDArray[np.int64] = field(init=False)
    false_positives: NDArray[np.int64] = field(init=False)

    def __post_init__(self) -> None:
        scores, present = scored(self.scores, self.present)
        both_classes(present, needed_by="a curve")
        falling, rank = np.unique(-scores, return_inverse=True)
        inside = np.bincount(rank[present], minlength=len(falling))
        outside = np.bincount(rank[~present], minlength=len(falling))
        curve = {
            "scores": scores,
            "present": present,
            "thresholds": np.concatenate([[math.inf], -falling]),
            "true_positives": np.concatenate([[0], np.cumsum(inside)]),
            "false_positives": np.concatenate([[0], np.cumsum(outside)]),
        }
        for name, value in curve.items():
            value.flags.writeable = False
            object.__setattr__(self, name, value)

    @classmethod
    def of(cls, scores: ArrayLike, present: ArrayLike) -> Roc:
        """Curve of a detector; parameters and errors as of the class.

        Examples
        --------
        >>> curve = Roc.of([0.1, 0.4, 0.35, 0.8], [False, False, True, True])
        >>> curve.auc, curve.auc_interval().method
        (0.75, 'newcombe')
        >>> [f"{end:.2f}" for end in curve.auc_interval()]
        ['0.23', '0.97']
        """
        return cls(scores=scores, present=present)  # type: ignore[arg-type]  # the value copies and checks them

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
        """Sensitivity at each threshold, rising from 0 to 1."""
        rate: NDArray[np.float64] = self.true_positives / self.targets
        return rate

    @property
    def false_positive_rate(self) -> NDArray[np.float64]:
        """One less specificity at each threshold, rising from 0 to 1."""
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
        true_positives, false_positives = int(self.true_positives[index]), int(self.false_positives[index])
        return Counts(
            true_positives=true_positives,
            false_positives=false_positives,
            true_negatives=self.blanks - false_positives,
            false_negatives=self.targets - true_positives,
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
            method = "delong" if _is_normal(self.auc, self.targets, self.blanks) else "newcombe"
        if choice("method", method, METHODS) == "delong":
            return _delong_interval(self.scores, self.present, level)
        if method == "newcombe":
            return newcombe_interval(self.auc, self.targets, self.blanks, level)
        if rng is None:
            raise InputError("rng must be given for the bootstrap; got None: give numpy.random.default_rng(seed)")
        return bootstrap_auc(self.scores, self.present, rng=rng, level=level, draws=draws, progress=progress)


def area(scores: NDArray[Any], present: NDArray[np.bool_]) -> float:
    """Area under the curve of checked scores, from Mann and Whitney's count, ties counted half."""
    inside, outside = _doubled_placements(scores, present)
    return int(inside.sum()) / (2 * len(inside) * len(outside))


def _doubled_placements(
    scores: NDArray[Any], present: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Twice the number of correctly ranked pairs of each target with the other class, for targets with and without.

    Whole numbers make equal rankings exactly equal. One sort replaces all pairs (Sun and Xu, IEEE Signal Process. Lett.
    21 (2014) 1389).
    """
    within, without = np.sort(scores[present]), np.sort(scores[~present])
    inside = np.searchsorted(without, scores[present], "left") + np.searchsorted(without, scores[present], "right")
    not_above = np.searchsorted(within, scores[~present], "left") + np.searchsorted(within, scores[~present], "right")
    return inside, 2 * len(within) - not_above


def newcombe_interval(auc: float, present: int, absent: int, level: float = LEVEL) -> Interval:
    """Interval of an area under the curve, from the area and the numbers of targets with and without an inclusion.

    Newcombe's method 5 (Stat. Med. 25 (2006) 559): all areas that a score test does not reject, with the variance of
    exponential scores. It is valid for few targets, and for areas of 0 and 1. Raises `InputError` when a number is out
    of its range.

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


def _is_normal(auc: float, present: int, absent: int) -> bool:
    """Whether DeLong's interval of an area covers as it says, as measured by ``benchmarks/detection_intervals.py``."""
    smaller = min(present, absent)
    return smaller >= FROM_TARGETS and smaller * min(auc, 1 - auc) >= FROM_ENDS


def _delong_interval(scores: NDArray[np.float64], present: NDArray[np.bool_], level: float = LEVEL) -> Interval:
    """DeLong's interval of one area, cut to [0, 1]; `InputError` where its variance is 0, as for areas of 0 and 1."""
    z = float(scipy.special.ndtri(0.5 + checked_level(level) / 2))
    found = auc_covariance(np.atleast_2d(scores), present)
    auc, variance = float(found.auc[0]), float(found.covariance[0, 0])
    if variance == 0:
        raise InputError(
            f"method must not be delong where its variance is 0, as for an area under the curve of {auc:g}: "
            "take newcombe, which holds there"
        )
    half = z * math.sqrt(variance)
    return Interval(low=max(auc - half, 0.0), high=min(auc + half, 1.0), level=level, method="delong")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AucCovariance:
    """Areas of several methods on the same targets, with their covariance."""

    auc: NDArray[np.float64]  #: areas under the curves, shape (methods,)
    covariance: NDArray[np.float64]  #: covariance of their errors, shape (methods, methods)
    #: present, absent: numbers of targets with and without an inclusion
    present: int
    absent: int

    def __post_init__(self) -> None:
        freeze_arrays(self, "auc", "covariance", dtype=float)


def auc_covariance(scores: ArrayLike, present: ArrayLike) -> AucCovariance:
    """Areas under the curves of several methods, and their covariance, from scores of shape (methods, targets).

    All methods score the same targets; at least two of each kind. Raises `InputError` when the scores are not finite or
    their shape does not fit, or a class has fewer than two targets.

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


def _placed(scores: NDArray[np.float64], present: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    pairs = [_doubled_placements(row, present) for row in scores]
    return np.stack([inside for inside, _ in pairs]), np.stack([outside for _, outside in pairs])


def _covariance(inside: NDArray[np.int64], outside: NDArray[np.int64]) -> NDArray[np.float64]:
    """From doubled placements of shapes (methods, m) and (methods, n); whole numbers leave exact zeros."""
    m, n = inside.shape[1], outside.shape[1]
    within = np.atleast_2d(np.cov(inside - inside[:, :1])) / (4 * n**2)
    without = np.atleast_2d(np.cov(outside - outside[:, :1])) / (4 * m**2)
    both: NDArray[np.float64] = within / m + without / n
    return both


def _difference_variance(scores: NDArray[np.float64], present: NDArray[np.bool_]) -> float:
    """Variance of the difference of two areas, from scores of shape (2, targets); exactly 0 where nothing varies."""
    inside, outside = _placed(scores, present)
    return float(_covariance(inside[:1] - inside[1:], outside[:1] - outside[1:])[0, 0])


def bootstrap_auc(
    scores: ArrayLike,
    present: ArrayLike,
    *,
    rng: np.random.Generator,
    level: float = LEVEL,
    draws: int = DRAWS,
    progress: Callable[[int, int], None] | None = None,
) -> Interval:
    """Percentile interval of an area under the curve, with the confidence ``level``, from the stratified bootstrap.

    The scores are those of `Roc`. ``draws`` studies, 100 or more, are drawn by ``rng``; ``progress`` is called with
    (done, total) after each batch. Raises `InputError` when the input is invalid, a class is missing, or all draws have
    the same area.

    Examples
    --------
    >>> truth = [False, False, False, True, True, True]
    >>> low, high = bootstrap_auc([1, 2, 4, 3, 5, 6], truth, rng=np.random.default_rng(0))
    >>> low < 8 / 9 <= high
    True
    """
    values, truth = scored(scores, present)
    checked_level(level)
    drawn = drawn_areas(values[None], truth, rng=rng, draws=draws, progress=progress)[:, 0]
    if np.ptp(drawn) == 0:
        raise InputError(
            f"method must not be bootstrap where every draw has the same area under the curve, {drawn[0]:g}: "
            "take newcombe, which holds there"
        )
    return percentiles(drawn, level)


def drawn_areas(
    scores: NDArray[np.float64],
    present: NDArray[np.bool_],
    *,
    rng: np.random.Generator,
    draws: int = DRAWS,
    progress: Callable[[int, int], None] | None = None,
) -> NDArray[np.float64]:
    """Areas of methods in resampled studies, shape (draws, methods), from scores of shape (methods, targets).

    All methods have the same targets. Raises `InputError` when a class is missing, ``rng`` is no generator, or
    ``draws`` lies outside its range.
    """
    m, n = both_classes(present, needed_by="a curve")
    draws = checked_draws(rng, draws)
    ranked = [_resampled_indices(row[present], row[~present]) for row in scores]
    areas = np.empty((draws, len(scores)))
    for start, stop in batches(draws, m + n, progress):
        inside = rng.multinomial(m, np.full(m, 1 / m), stop - start)
        outside = rng.multinomial(n, np.full(n, 1 / n), stop - start)
        for index, (order, left, right) in enumerate(ranked):
            below = np.zeros((stop - start, n + 1), dtype=np.int64)
            np.cumsum(outside[:, order], axis=1, out=below[:, 1:])
            ordered_pairs = (inside * (below[:, left] + below[:, right])).sum(axis=1)
            areas[start:stop, index] = ordered_pairs / (2 * m * n)
    return areas


def _resampled_indices(
    inside: NDArray[np.float64], outside: NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Order of the targets without inclusion, and the numbers of them below, and not above, each target with."""
    order = np.argsort(outside)
    ranked = outside[order]
    return order, np.searchsorted(ranked, inside, "left"), np.searchsorted(ranked, inside, "right")


def percentiles(drawn: NDArray[np.float64], level: float) -> Interval:
    """Percentile interval of the draws."""
    low, high = np.quantile(drawn, [(1 - level) / 2, (1 + level) / 2])
    return Interval(low=float(low), high=float(high), level=level, method="bootstrap")


def batches(draws: int, targets: int, progress: Callable[[int, int], None] | None) -> Iterator[tuple[int, int]]:
    """First and last draw of each batch of limited memory; reports each finished batch."""
    size = max(AT_ONCE // targets, 1)
    for start in range(0, draws, size):
        stop = min(start + size, draws)
        yield start, stop
        if progress is not None:
            progress(stop, draws)


def checked_draws(rng: object, draws: int) -> int:
    """Check the number of draws and the random generator."""
    if not isinstance(rng, np.random.Generator):
        raise InputError(f"rng must be a numpy.random.Generator; got {rng!r:.60}: give numpy.random.default_rng(seed)")
    return require_integer("draws", draws, 100, MOST_DRAWS)


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Two methods on the same targets."""

    #: first_auc, second_auc: their areas under the curve
    first_auc: float
    second_auc: float
    difference: float  #: first less second
    method: str  #: ``"delong"`` or ``"bootstrap"``
    standard_error: float  #: of the difference; 0 where it does not vary
    interval: Interval | None  #: of the difference; None where it does not vary
    #: z, p: difference in standard errors, and its two-sided p-value; None where it does not vary
    z: float | None
    p: float | None
    remark: str = ""  #: reason of a missing interval and test, else empty


def compare_detectors(first: ArrayLike, second: ArrayLike, present: ArrayLike, *, level: float = LEVEL) -> Comparison:
    """Compare two methods by DeLong's paired test, from their scores of the same targets, shape (targets,).

    The test assumes a normal distribution: below some 30 targets of each kind it is approximate. ``level`` is the
    confidence of the interval. Raises `InputError` when the input is bad, or a class has fewer than two targets.

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
    spread = math.sqrt(_difference_variance(scores, truth))
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
    """Compare two methods as `compare_detectors`, by the stratified bootstrap with the same resampled targets for both.

    The interval is that of percentiles; the test divides the difference by the standard deviation of the draws. One
    target of each kind is enough; ``rng``, ``level``, ``draws`` and ``progress`` are as for `bootstrap_auc`. Raises
    `InputError` when the input is bad, or a class is missing.
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


@dataclass(frozen=True, slots=True, kw_only=True)
class OperatingPoint:
    """A threshold and its counts on the targets on which it was chosen.

    Counts and intervals are optimistic, because the threshold was chosen on the same targets.
    """

    #: least score that is decided as an inclusion, midway between the separated scores; infinite or minus infinity
    #: where no or all targets are
    threshold: float
    counts: Counts  #: of the decisions
    rule: str  #: rule of the choice

    def decide(self, scores: ArrayLike) -> NDArray[np.bool_]:
        """Decide which targets have an inclusion, from finite scores of shape (targets,); else `InputError`."""
        decided: NDArray[np.bool_] = require_array("scores", scores, ndim=1) >= self.threshold
        return decided


def youden_point(curve: Roc) -> OperatingPoint:
    """The threshold of the largest sensitivity + specificity - 1; among equals that of the highest specificity.

    Examples
    --------
    >>> point = youden_point(Roc.of([1, 2, 3, 4, 5], [False, False, True, False, True]))
    >>> point.threshold, point.counts.sensitivity.value, round(point.counts.specificity.value, 3)
    (2.5, 1.0, 0.667)
    """
    gained = curve.true_positives * curve.blanks - curve.false_positives * curve.targets  # whole numbers: ties are ties
    return _point(curve, int(np.argmax(gained)), "largest sensitivity + specificity - 1")


def at_sensitivity(curve: Roc, requested: float) -> OperatingPoint:
    """The highest threshold whose sensitivity is at least ``requested``, in [0, 1]; else `InputError`.

    Examples
    --------
    >>> at_sensitivity(Roc.of([1, 2, 3, 4, 5], [False, False, True, False, True]), 0.5).threshold
    4.5
    """
    require_number("requested", requested, 0, 1, hint="a sensitivity")
    enough = curve.true_positives >= requested * curve.targets - ROUNDING
    return _point(curve, int(np.argmax(enough)), f"sensitivity of at least {requested:g}")


def at_specificity(curve: Roc, requested: float) -> OperatingPoint:
    """The threshold of the largest sensitivity whose specificity is at least ``requested``; of equals the highest.

    ``requested`` lies in [0, 1]; else `InputError` is raised.

    Examples
    --------
    >>> at_specificity(Roc.of([1, 2, 3, 4, 5], [False, False, True, False, True]), 0.6).threshold
    2.5
    """
    require_number("requested", requested, 0, 1, hint="a specificity")
    allowed = curve.blanks - curve.false_positives >= requested * curve.blanks - ROUNDING
    best = int(np.argmax(np.where(allowed, curve.true_positives, -1)))
    return _point(curve, best, f"specificity of at least {requested:g}")


def at_costs(curve: Roc, *, prevalence: float, missed: float, false_alarm: float) -> OperatingPoint:
    """The threshold of the least expected cost; among equals that of the highest specificity.

    ``prevalence`` is the fraction of targets with an inclusion where the threshold will be used, in [0, 1]. ``missed``
    and ``false_alarm`` are the costs of a missed inclusion and of a false one, in any common unit, not negative and not
    both 0. Other numbers raise `InputError`.

    Examples
    --------
    >>> curve = Roc.of([1, 2, 3, 4, 5], [False, False, True, False, True])
    >>> [at_costs(curve, prevalence=0.5, missed=cost, false_alarm=1).threshold for cost in (0.5, 5)]
    [4.5, 2.5]
    """
    require_number("prevalence", prevalence, 0, 1, hint="a fraction of targets")
    costs = [require_number(name, cost, 0, 1e100) for name, cost in (("missed", missed), ("false_alarm", false_alarm))]
    if not any(costs):
        raise InputError("missed or false_alarm must cost something; got 0 for both")
    of_missed = prevalence * missed * (1 - curve.true_positive_rate)
    cost = of_missed + (1 - prevalence) * false_alarm * curve.false_positive_rate
    least = cost <= cost.min() * (1 + ROUNDING)
    rule = f"least cost: {missed:g} a miss, {false_alarm:g} a false alarm, prevalence {prevalence:g}"
    return _point(curve, int(np.argmax(least)), rule)


def _point(curve: Roc, index: int, rule: str) -> OperatingPoint:
    return OperatingPoint(threshold=_between(curve.thresholds, index), counts=curve.counts(index), rule=rule)


def _between(thresholds: NDArray[np.float64], index: int) -> float:
    """Midpoint to the next lower score."""
    if index == 0:
        return math.inf
    if index == len(thresholds) - 1:
        return -math.inf
    upper, lower = float(thresholds[index]), float(thresholds[index + 1])
    middle = upper / 2 + lower / 2
    return middle if lower < middle <= upper else upper  # there is no number between neighbouring floats


def held_out_counts(
    scores: ArrayLike,
    present: ArrayLike,
    choose: Callable[[Roc], OperatingPoint],
    *,
    folds: int | None = None,
    rng: np.random.Generator | None = None,
) -> Counts:
    """Cross-validated decisions: a rule, as `youden_point`, chooses each threshold without the targets it decides.

    The scores are those of `Roc`, of at least two targets of each kind. There are stratified ``folds``, which ``rng``
    shuffles; None leaves out one target at a time. Raises `InputError` when the input is invalid, a class has fewer
    than two targets, or ``folds`` is not in 2 to their number.

    Examples
    --------
    >>> truth, scores = [False, False, False, True, True, True], [1, 3, 2, 2.5, 5, 6]
    >>> youden_point(Roc.of(scores, truth)).counts.accuracy.value
    0.8333333333333334
    >>> held_out_counts(scores, truth, youden_point).accuracy.value
    0.6666666666666666
    """
    values, truth = scored(scores, present)
    both_classes(truth, least=2, needed_by="a threshold chosen on other targets")
    decided = np.empty(len(truth), dtype=bool)
    for left_out in _parts(truth, folds, rng):
        others = ~left_out
        decided[left_out] = choose(Roc(scores=values[others], present=truth[others])).decide(values[left_out])
    return Counts.of(decided, truth)


def _parts(truth: NDArray[np.bool_], folds: int | None, rng: np.random.Generator | None) -> list[NDArray[np.bool_]]:
    if folds is None:
        return list(np.eye(len(truth), dtype=bool))
    least = min(int(np.count_nonzero(truth)), int(np.count_nonzero(~truth)))
    folds = require_integer("folds", folds, 2, least, hint="not more than there are targets of either kind")
    if not isinstance(rng, np.random.Generator):
        raise InputError(f"rng must be a numpy.random.Generator where there are folds; got {rng!r:.60}")
    part = np.empty(len(truth), dtype=int)
    for kind in (True, False):
        members = rng.permutation(np.flatnonzero(truth == kind))
        part[members] = np.arange(len(members)) % folds
    return [part == index for index in range(folds)]
