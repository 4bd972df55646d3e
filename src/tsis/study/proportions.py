"""Proportions and counts of decisions, with confidence intervals.

The intervals are this module's own: those of statsmodels lose the exact ends 0 and 1, and its score interval of a ratio
fails where a count is 0 or everything was found.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from tsis.errors import InputError
from tsis.model.require import require_array, require_integer, require_number

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import ArrayLike, NDArray


LEVEL = 0.95


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """Confidence interval; ``low, high = interval`` unpacks it.

    Examples
    --------
    >>> low, high = Interval(low=0.4, high=0.9, level=0.95, method="wilson")
    >>> low, high
    (0.4, 0.9)
    """

    #: low, high: ends, included; an end may be infinite
    low: float
    high: float
    level: float  #: probability that such intervals contain the true value, in (0, 1)
    method: str  #: Its method, e.g. ``"wilson"``.

    def __iter__(self) -> Iterator[float]:
        return iter((self.low, self.high))

    def holds(self, value: float) -> bool:
        """Whether a value lies in the interval, its ends included."""
        return self.low <= value <= self.high


def checked_level(level: float) -> float:
    """Check a level of confidence."""
    return require_number("level", level, 1e-6, 1 - 1e-9, hint="a probability, such as 0.95")


LARGEST_READING = 1e70  # its fourth power does not overflow
ABSENT = {
    True: "score at least {least} that {hold} an inclusion",
    False: "score at least {least} that {hold} none",
}


def booleans(name: str, value: ArrayLike) -> NDArray[np.bool_]:
    """Return a read-only copy of a row of truth values, not empty.

    Raises `InputError` when it is empty, masked, has more axes than one, or holds anything but True and False.
    """
    if np.ma.is_masked(value):
        raise InputError(f"{name} must not hold masked values; leave those targets out before")
    try:
        flags = np.array(value)
    except ValueError as error:
        raise InputError(f"{name} must be one row of True and False; got rows of unequal lengths") from error
    if flags.ndim != 1:
        raise InputError(f"{name} must be one row of True and False; got shape {flags.shape}")
    if flags.size == 0:
        raise InputError(f"{name} must not be empty; give one value a target")
    if flags.dtype.kind != "b":
        raise InputError(
            f"{name} must hold True and False alone; got {flags.dtype.name} as {flags[0]!r:.40}: "
            f"compare first, such as numbers == 1"
        )
    flags.flags.writeable = False
    return flags


def scored(scores: ArrayLike, present: ArrayLike, *, name: str = "scores") -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Check scores and truth, one of each per target.

    Raises `InputError` when either is empty or no row, a score is not finite, or their lengths differ.
    """
    values = require_array(name, scores, ndim=1)
    truth = booleans("present", present)
    same_length(name, values, "present", truth)
    return values, truth


def same_length(name: str, value: NDArray[Any], other_name: str, other: NDArray[Any]) -> None:
    """Refuse two rows of different lengths."""
    if len(value) != len(other):
        raise InputError(
            f"{name} and {other_name} must be equally long, one value a target; got {len(value)} and {len(other)}"
        )


def both_classes(present: NDArray[np.bool_], *, least: int = 1, needed_by: str) -> tuple[int, int]:
    """Numbers of targets with and without an inclusion, both at least ``least``.

    Raises `InputError` when a class is missing or too small; the message names it.
    """
    inside = int(np.count_nonzero(present))
    numbers = {True: inside, False: len(present) - inside}
    for value, number in numbers.items():
        if number < least:
            targets, hold = ("target", "holds") if least == 1 else ("targets", "hold")
            cure = ABSENT[value].format(least=f"{least} {targets}", hold=hold)
            raise InputError(
                f"present must be {value} for at least {least} {targets} for {needed_by}; got {number} "
                f"of {len(present)}: {cure}"
            )
    return inside, len(present) - inside


def checked_readings(name: str, value: ArrayLike, *, ndim: int) -> NDArray[np.float64]:
    """Return a read-only copy of finite readings whose fourth powers are finite too.

    Raises `InputError` when they are empty, of another shape or too large.
    """
    values = require_array(name, value, ndim=ndim)
    largest = float(np.abs(values).max())
    if largest > LARGEST_READING:
        raise InputError(f"{name} must lie within ±{LARGEST_READING:g}; got {largest:g}: choose a larger unit")
    return values


def choice(name: str, value: str, choices: tuple[str, ...]) -> str:
    """Check that a text is among ``choices``."""
    if not isinstance(value, str) or value not in choices:
        raise InputError(f"{name} must be one of {', '.join(choices)}; got {value!r:.60}")
    return value


MOST_TRIALS = 10**12


@dataclass(frozen=True, slots=True, kw_only=True)
class Proportion:
    """A binomial proportion.

    Raises `InputError` when a number is not whole or out of its range.

    Examples
    --------
    The printed study on phantoms has 6 of 8 true positives and 7 of 8 true negatives; the intervals are wide:

    >>> found, empty = Proportion(successes=6, trials=8), Proportion(successes=7, trials=8)
    >>> found.value, empty.value
    (0.75, 0.875)
    >>> [f"{end:.3f}" for end in found.interval()]
    ['0.409', '0.929']
    >>> [f"{end:.3f}" for end in empty.interval()]
    ['0.529', '0.978']
    """

    successes: int  #: from 0 to ``trials``
    trials: int  #: 1 or more

    def __post_init__(self) -> None:
        trials = require_integer("trials", self.trials, 1, MOST_TRIALS)
        successes = require_integer("successes", self.successes, 0, trials, hint=f"of {trials} trials")
        object.__setattr__(self, "trials", trials)
        object.__setattr__(self, "successes", successes)

    @property
    def value(self) -> float:
        """The proportion, in [0, 1]."""
        return self.successes / self.trials

    def interval(self, level: float = LEVEL, method: str = "wilson") -> Interval:
        """Interval of the true proportion with the confidence ``level``, in (0, 1).

        The method is ``"wilson"``, with a mean coverage near the level, or ``"exact"`` (Clopper and Pearson), which is
        wider, with a coverage of at least the level. Other levels and methods raise `InputError`.
        """
        of = wilson_interval if choice("method", method, ("wilson", "exact")) == "wilson" else exact_interval
        return of(self.successes, self.trials, level)


def wilson_interval(successes: int, trials: int, level: float = LEVEL) -> Interval:
    """Wilson's score interval of a `Proportion`: all proportions that a score test does not reject.

    ``level`` is the confidence, in (0, 1). Raises `InputError` when a number is out of its range.
    """
    counted = Proportion(successes=successes, trials=trials)
    squared = float(scipy.special.ndtri(0.5 + checked_level(level) / 2)) ** 2
    failures = trials - successes
    middle = successes + squared / 2
    half = math.sqrt(squared * (successes * failures / trials + squared / 4))
    low = 0.0 if successes == 0 else (middle - half) / (trials + squared)
    high = 1.0 if failures == 0 else (middle + half) / (trials + squared)
    return Interval(low=min(low, counted.value), high=max(high, counted.value), level=level, method="wilson")


def exact_interval(successes: int, trials: int, level: float = LEVEL) -> Interval:
    """Clopper and Pearson's interval of a `Proportion`, from the binomial distribution: it covers at least ``level``.

    ``level`` is the confidence, in (0, 1). Raises `InputError` when a number is out of its range.
    """
    Proportion(successes=successes, trials=trials)
    tail, failures = (1 - checked_level(level)) / 2, trials - successes
    low = float(scipy.special.betaincinv(successes, failures + 1, tail)) if successes else 0.0
    high = float(scipy.special.betaincinv(successes + 1, failures, 1 - tail)) if failures else 1.0
    return Interval(low=low, high=high, level=level, method="exact")


SMALLEST_RATIO, LARGEST_RATIO = 1e-40, 1e15  # range of the search for the ends


@dataclass(frozen=True, slots=True, kw_only=True)
class ProportionRatio:
    """Ratio of two proportions, such as a likelihood ratio.

    Raises `InputError` when both proportions are 0.

    Examples
    --------
    >>> ratio = ProportionRatio(first=Proportion(successes=6, trials=8), second=Proportion(successes=1, trials=8))
    >>> ratio.value
    6.0
    >>> [f"{end:.2f}" for end in ratio.interval()]
    ['1.37', '34.35']
    """

    #: first, second: proportions of two groups without common targets; not both 0
    first: Proportion
    second: Proportion

    def __post_init__(self) -> None:
        if self.first.successes == self.second.successes == 0:
            raise InputError(
                f"first or second must count at least one, for their ratio to exist; got 0 of {self.first.trials} "
                f"and 0 of {self.second.trials}: collect more targets"
            )

    @property
    def value(self) -> float:
        """The ratio; infinite where the second proportion is 0."""
        return self.first.value / self.second.value if self.second.successes else math.inf

    def interval(self, level: float = LEVEL) -> Interval:
        """Koopman's score interval, which is valid for small groups and for proportions of 0 and 1.

        ``level`` is the confidence, in (0, 1); else `InputError` is raised.
        """
        z = float(scipy.special.ndtri(0.5 + checked_level(level) / 2))
        low = 0.0 if self.first.successes == 0 else 1 / self._upper_end(z, self.second, self.first)
        high = math.inf if self.second.successes == 0 else self._upper_end(z, self.first, self.second)
        return Interval(low=low, high=high, level=level, method="koopman")

    @staticmethod
    def _upper_end(z: float, first: Proportion, second: Proportion) -> float:
        """Largest ratio of first to second that the score test does not reject."""
        start = first.value / second.value or SMALLEST_RATIO
        end = start
        while end < LARGEST_RATIO * max(start, 1) and _score_of_ratio(first, second, end) < z:
            end *= 2

        def beyond(log: float) -> float:
            return _score_of_ratio(first, second, math.exp(log)) - z

        return math.exp(scipy.optimize.brentq(beyond, math.log(start), math.log(end), xtol=1e-13, rtol=1e-14))


@dataclass(frozen=True, slots=True, kw_only=True)
class ProportionDifference:
    """Difference of two proportions, such as Youden's index.

    Examples
    --------
    >>> youden = ProportionDifference(first=Proportion(successes=6, trials=8), second=Proportion(successes=1, trials=8))
    >>> youden.value
    0.625
    >>> [f"{end:.2f}" for end in youden.interval()]
    ['0.14', '0.83']
    """

    #: first, second: proportions of two groups without common targets
    first: Proportion
    second: Proportion

    @property
    def value(self) -> float:
        """The difference, in [-1, 1]."""
        return self.first.value - self.second.value

    def interval(self, level: float = LEVEL) -> Interval:
        """Newcombe's hybrid interval (1998, method 10), from the Wilson intervals of both proportions.

        ``level`` is the confidence, in (0, 1); else `InputError` is raised.
        """
        first, second = self.first.interval(level), self.second.interval(level)
        below = math.hypot(self.first.value - first.low, second.high - self.second.value)
        above = math.hypot(first.high - self.first.value, self.second.value - second.low)
        return Interval(low=self.value - below, high=self.value + above, level=level, method="newcombe")


def _score_of_ratio(first: Proportion, second: Proportion, ratio: float) -> float:
    """Score statistic of independent proportions under a true ratio of first to second, in standard errors."""
    m, n, x, y = first.trials, second.trials, first.successes, second.successes
    # The likelihood under that ratio is largest at a root of a quadratic in the first proportion.
    linear = ratio * (m + y) + x + n
    root = math.sqrt(max(linear**2 - 4 * ratio * (m + n) * (x + y), 0.0))
    one = 2 * ratio * (x + y) / (linear + root)
    two = min(one / ratio, 1.0)
    variance = one * (1 - min(one, 1.0)) / m + ratio**2 * two * (1 - two) / n
    away = ratio * second.value - first.value
    if variance <= 0:
        return 0.0 if away == 0 else math.copysign(math.inf, away)
    return away / math.sqrt(variance)


@dataclass(frozen=True, slots=True, kw_only=True)
class Counts:
    """Counts of decisions by truth.

    A rate is a `Proportion` with an interval; `InputError` is raised where the study has no target of its denominator.
    Raises `InputError` when a number is not whole or negative, or all are 0.

    Examples
    --------
    >>> printed = Counts(true_positives=6, false_negatives=2, true_negatives=7, false_positives=1)
    >>> printed.sensitivity.value, printed.specificity.value
    (0.75, 0.875)
    """

    true_positives: int  #: targets with an inclusion, decided present
    false_positives: int  #: targets without an inclusion, decided present
    true_negatives: int  #: targets without an inclusion, decided absent
    false_negatives: int  #: targets with an inclusion, decided absent

    def __post_init__(self) -> None:
        for name in ("true_positives", "false_positives", "true_negatives", "false_negatives"):
            object.__setattr__(self, name, require_integer(name, getattr(self, name), 0, MOST_TRIALS // 4))
        if self.targets == 0:
            raise InputError("counts must hold at least one target; got 0 of every kind")

    @classmethod
    def of(cls, decided: ArrayLike, present: ArrayLike) -> Counts:
        """Count decisions of targets and whether an inclusion was ``present``, booleans of shape (targets,).

        Raises `InputError` when either is empty or not boolean, or their lengths differ.

        Examples
        --------
        >>> Counts.of([True, True, False], [True, False, False])
        Counts(true_positives=1, false_positives=1, true_negatives=1, false_negatives=0)
        """
        positive, truth = booleans("decided", decided), booleans("present", present)
        same_length("decided", positive, "present", truth)
        return cls(
            true_positives=int(np.count_nonzero(positive & truth)),
            false_positives=int(np.count_nonzero(positive & ~truth)),
            true_negatives=int(np.count_nonzero(~positive & ~truth)),
            false_negatives=int(np.count_nonzero(~positive & truth)),
        )

    @property
    def targets(self) -> int:
        """All targets."""
        return self.present + self.absent

    @property
    def present(self) -> int:
        """Targets with an inclusion."""
        return self.true_positives + self.false_negatives

    @property
    def absent(self) -> int:
        """Targets without one."""
        return self.true_negatives + self.false_positives

    @property
    def sensitivity(self) -> Proportion:
        """Fraction of present inclusions decided present: equation (2.2) of the dissertation."""
        return _proportion("sensitivity", self.true_positives, self.present, "target with an inclusion")

    @property
    def specificity(self) -> Proportion:
        """Fraction of targets without inclusion decided absent: equation (2.3) of the dissertation."""
        return _proportion("specificity", self.true_negatives, self.absent, "target without an inclusion")

    @property
    def accuracy(self) -> Proportion:
        """Fraction of correct decisions; it depends on the prevalence."""
        return Proportion(successes=self.true_positives + self.true_negatives, trials=self.targets)

    @property
    def positive_predictive_value(self) -> Proportion:
        """Fraction of inclusions present among those decided present, at the prevalence of this study."""
        decided = self.true_positives + self.false_positives
        return _proportion("positive_predictive_value", self.true_positives, decided, "target decided present")

    @property
    def negative_predictive_value(self) -> Proportion:
        """Fraction of targets without inclusion among those decided absent, at the prevalence of this study."""
        decided = self.true_negatives + self.false_negatives
        return _proportion("negative_predictive_value", self.true_negatives, decided, "target decided absent")

    @property
    def positive_likelihood_ratio(self) -> ProportionRatio:
        """Factor of a positive decision on the odds of an inclusion: sensitivity / (1 - specificity)."""
        return ProportionRatio(first=self.sensitivity, second=_complement(self.specificity))

    @property
    def negative_likelihood_ratio(self) -> ProportionRatio:
        """Factor of a negative decision on the odds of an inclusion: (1 - sensitivity) / specificity."""
        return ProportionRatio(first=_complement(self.sensitivity), second=self.specificity)

    @property
    def youden(self) -> ProportionDifference:
        """Youden's index, sensitivity + specificity - 1: 1 at best, 0 by chance."""
        return ProportionDifference(first=self.sensitivity, second=_complement(self.specificity))


def _proportion(name: str, successes: int, trials: int, needed: str) -> Proportion:
    if trials == 0:
        raise InputError(f"{name} must have at least one {needed} to be a fraction of; got 0: add such targets")
    return Proportion(successes=successes, trials=trials)


def _complement(proportion: Proportion) -> Proportion:
    return Proportion(successes=proportion.trials - proportion.successes, trials=proportion.trials)
