"""Proportions, such as a sensitivity, their ratios and differences, with intervals."""

from __future__ import annotations

import math
from dataclasses import dataclass

import scipy

from tsis.detection._inputs import LEVEL, Interval, checked_level, choice
from tsis.errors import InputError
from tsis.model import require_integer

MOST_TRIALS = 10**12


@dataclass(frozen=True, slots=True, kw_only=True)
class Proportion:
    """A binomial proportion.

    Raises `InputError` when a number is not whole or out of its range.

    Parameters
    ----------
    successes
        From 0 to ``trials``.
    trials
        1 or more.

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

    successes: int
    trials: int

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
    """Wilson's score interval: all proportions that a score test does not reject.

    Raises `InputError` when a number is out of its range.

    Parameters
    ----------
    successes, trials
        As for `Proportion`.
    level
        Confidence, in (0, 1).

    Examples
    --------
    >>> wilson_interval(8, 8).high
    1.0
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
    """Clopper and Pearson's interval of a proportion, from the binomial distribution.

    Raises `InputError` when a number is out of its range.

    Parameters
    ----------
    successes, trials
        As for `Proportion`.
    level
        Confidence, in (0, 1); true coverage is never less.

    Examples
    --------
    >>> [round(end, 3) for end in exact_interval(6, 8)]
    [0.349, 0.968]
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

    Parameters
    ----------
    first, second
        Proportions of two groups without common targets; not both 0.

    Examples
    --------
    >>> from tsis.detection import Proportion
    >>> ratio = ProportionRatio(first=Proportion(successes=6, trials=8), second=Proportion(successes=1, trials=8))
    >>> ratio.value
    6.0
    >>> [f"{end:.2f}" for end in ratio.interval()]
    ['1.37', '34.35']
    """

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
        while end < LARGEST_RATIO * max(start, 1) and score_of_ratio(first, second, end) < z:
            end *= 2

        def beyond(log: float) -> float:
            return score_of_ratio(first, second, math.exp(log)) - z

        return math.exp(scipy.optimize.brentq(beyond, math.log(start), math.log(end), xtol=1e-13, rtol=1e-14))


@dataclass(frozen=True, slots=True, kw_only=True)
class ProportionDifference:
    """Difference of two proportions, such as Youden's index.

    Parameters
    ----------
    first, second
        Proportions of two groups without common targets.

    Examples
    --------
    >>> from tsis.detection import Proportion
    >>> youden = ProportionDifference(first=Proportion(successes=6, trials=8), second=Proportion(successes=1, trials=8))
    >>> youden.value
    0.625
    >>> [f"{end:.2f}" for end in youden.interval()]
    ['0.14', '0.83']
    """

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


def score_of_ratio(first: Proportion, second: Proportion, ratio: float) -> float:
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
