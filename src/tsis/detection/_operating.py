"""Choice of the threshold: operating points of a curve.

A point is optimistic on the targets on which it was chosen; `held_out_counts` chooses on other targets than it counts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.detection._counts import Counts
from tsis.detection._inputs import both_classes, scored
from tsis.detection._roc import Roc
from tsis.errors import InputError
from tsis.model import require_array, require_integer, require_number

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray


ROUNDING = 1e-9  # of a requested rate times the number of targets: 0.7 of 10 are 7


@dataclass(frozen=True, slots=True, kw_only=True)
class OperatingPoint:
    """A threshold and its counts on the targets on which it was chosen.

    Counts and intervals are optimistic, because the threshold was chosen on the same targets.

    Attributes
    ----------
    threshold
        Least score that is decided as an inclusion, midway between the separated scores; infinite or minus infinity
        where no or all targets are.
    counts
        Of the decisions.
    rule
        Rule of the choice.
    """

    threshold: float
    counts: Counts
    rule: str

    def decide(self, scores: ArrayLike) -> NDArray[np.bool_]:
        """Decide which targets have an inclusion, from finite scores of shape (targets,); else `InputError`."""
        decided: NDArray[np.bool_] = require_array("scores", scores, ndim=1) >= self.threshold
        return decided


def youden_point(curve: Roc) -> OperatingPoint:
    """The threshold of the largest sensitivity + specificity - 1; among equals that of the highest specificity.

    Examples
    --------
    >>> from tsis.detection import roc
    >>> point = youden_point(roc([1, 2, 3, 4, 5], [False, False, True, False, True]))
    >>> point.threshold, point.counts.sensitivity.value, round(point.counts.specificity.value, 3)
    (2.5, 1.0, 0.667)
    """
    gained = curve.true_positives * curve.blanks - curve.false_positives * curve.targets  # whole numbers: ties are ties
    return _point(curve, int(np.argmax(gained)), "largest sensitivity + specificity - 1")


def at_sensitivity(curve: Roc, requested: float) -> OperatingPoint:
    """The highest threshold whose sensitivity is at least ``requested``, in [0, 1]; else `InputError`.

    Examples
    --------
    >>> from tsis.detection import roc
    >>> at_sensitivity(roc([1, 2, 3, 4, 5], [False, False, True, False, True]), 0.5).threshold
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
    >>> from tsis.detection import roc
    >>> at_specificity(roc([1, 2, 3, 4, 5], [False, False, True, False, True]), 0.6).threshold
    2.5
    """
    require_number("requested", requested, 0, 1, hint="a specificity")
    allowed = curve.blanks - curve.false_positives >= requested * curve.blanks - ROUNDING
    best = int(np.argmax(np.where(allowed, curve.true_positives, -1)))
    return _point(curve, best, f"specificity of at least {requested:g}")


def at_costs(curve: Roc, *, prevalence: float, missed: float, false_alarm: float) -> OperatingPoint:
    """The threshold of the least expected cost; among equals that of the highest specificity.

    Raises `InputError` when a number is out of its range.

    Parameters
    ----------
    curve
        The detector.
    prevalence
        Fraction of targets with an inclusion where the threshold will be used, in [0, 1].
    missed, false_alarm
        Costs of a missed inclusion and of a false one, in any common unit, not negative and not both 0.

    Examples
    --------
    >>> from tsis.detection import roc
    >>> curve = roc([1, 2, 3, 4, 5], [False, False, True, False, True])
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


def held_out_counts(
    scores: ArrayLike,
    present: ArrayLike,
    choose: Callable[[Roc], OperatingPoint],
    *,
    folds: int | None = None,
    rng: np.random.Generator | None = None,
) -> Counts:
    """Cross-validated decisions: each threshold is chosen without the targets on which it decides.

    Raises `InputError` when the input is invalid, a class has fewer than two targets, or ``folds`` is not in 2 to their
    number.

    Parameters
    ----------
    scores, present
        As for `tsis.detection._roc`; at least two targets of each kind.
    choose
        Rule of the point on the curve of the others, e.g. `youden_point`.
    folds
        Number of stratified folds; None leaves out one target at a time.
    rng
        Shuffles the folds; needed with ``folds``.

    Examples
    --------
    >>> truth, scores = [False, False, False, True, True, True], [1, 3, 2, 2.5, 5, 6]
    >>> from tsis.detection import roc
    >>> youden_point(roc(scores, truth)).counts.accuracy.value
    0.8333333333333334
    >>> held_out_counts(scores, truth, youden_point).accuracy.value
    0.6666666666666666
    """
    values, truth = scored(scores, present)
    both_classes(truth, least=2, needed_by="a threshold chosen on other targets")
    decided = np.empty(len(truth), dtype=bool)
    for left_out in _parts(truth, folds, rng):
        selected = ~left_out
        decided[left_out] = choose(Roc(scores=values[selected], present=truth[selected])).decide(values[left_out])
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
