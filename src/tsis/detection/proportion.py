"""A share of targets, such as a sensitivity, and its interval."""

from __future__ import annotations

import math
from dataclasses import dataclass

from scipy.special import betaincinv, ndtri

from tsis.detection.inputs import choice
from tsis.detection.interval import LEVEL, Interval, checked_level
from tsis.model.check import require_integer

MOST_TRIALS = 10**12


@dataclass(frozen=True, slots=True, kw_only=True)
class Proportion:
    """So many of so many.

    Parameters
    ----------
    successes
        How many, from 0 to ``trials``.
    trials
        Of how many, 1 or more.

    Raises
    ------
    InputError
        When a number is not whole or out of its range.

    Examples
    --------
    The printed study on phantoms found 6 of 8 inclusions and called 7 of 8 places without any empty. So few say little:

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
        """The share, in [0, 1]."""
        return self.successes / self.trials

    def interval(self, level: float = LEVEL, method: str = "wilson") -> Interval:
        """Interval of the share behind the count.

        Parameters
        ----------
        level
            Confidence, in (0, 1).
        method
            ``"wilson"``, whose mean coverage is near the level, or ``"exact"`` (Clopper and Pearson), which covers at
            least with ``level`` and is wider for it.

        Raises
        ------
        InputError
            When the level is no probability, or the method unknown.
        """
        of = wilson_interval if choice("method", method, ("wilson", "exact")) == "wilson" else exact_interval
        return of(self.successes, self.trials, level)


def wilson_interval(successes: int, trials: int, level: float = LEVEL) -> Interval:
    """Wilson's score interval of a share: all shares that a score test does not reject.

    Parameters
    ----------
    successes, trials
        As for `Proportion`.
    level
        Confidence, in (0, 1).

    Raises
    ------
    InputError
        When a number is out of its range.

    Examples
    --------
    >>> wilson_interval(8, 8).high
    1.0
    """
    counted = Proportion(successes=successes, trials=trials)
    squared = float(ndtri(0.5 + checked_level(level) / 2)) ** 2
    failures = trials - successes
    middle = successes + squared / 2
    half = math.sqrt(squared * (successes * failures / trials + squared / 4))
    low = 0.0 if successes == 0 else (middle - half) / (trials + squared)
    high = 1.0 if failures == 0 else (middle + half) / (trials + squared)
    return Interval(low=min(low, counted.value), high=max(high, counted.value), level=level, method="wilson")


def exact_interval(successes: int, trials: int, level: float = LEVEL) -> Interval:
    """Clopper and Pearson's interval of a share, from the binomial law itself.

    Parameters
    ----------
    successes, trials
        As for `Proportion`.
    level
        Confidence, in (0, 1); true coverage is never less.

    Raises
    ------
    InputError
        When a number is out of its range.

    Examples
    --------
    >>> [round(end, 3) for end in exact_interval(6, 8)]
    [0.349, 0.968]
    """
    Proportion(successes=successes, trials=trials)
    tail, failures = (1 - checked_level(level)) / 2, trials - successes
    low = float(betaincinv(successes, failures + 1, tail)) if successes else 0.0
    high = float(betaincinv(successes + 1, failures, 1 - tail)) if failures else 1.0
    return Interval(low=low, high=high, level=level, method="exact")


__all__ = ["Proportion", "exact_interval", "wilson_interval"]
