"""Quality of probabilities: the Brier score, its decomposition by Murphy, and the reliability curve."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.detection._bootstrap import DRAWS, batches, checked_draws, percentiles
from tsis.detection._inputs import LEVEL, Interval, checked_level, choice, scored
from tsis.detection._proportions import Proportion
from tsis.errors import InputError
from tsis.model import require_integer

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class BrierScore:
    """Mean square of probability less truth, 0 at best, and its decomposition.

    ``score = reliability - resolution + uncertainty + within``.

    Attributes
    ----------
    score
        In [0, 1].
    reliability
        Mean square of a group's probability less its frequency of inclusions; 0 is best.
    resolution
        Mean square of a group's frequency less that of all; larger is better.
    uncertainty
        Score of the frequency of all as the constant probability.
    within
        Contribution of different probabilities within a group; 0 where groups have equal probabilities.
    """

    score: float
    reliability: float
    resolution: float
    uncertainty: float
    within: float


def brier_score(probabilities: ArrayLike, present: ArrayLike, *, groups: ArrayLike | None = None) -> BrierScore:
    """Brier score of probabilities, in Murphy's parts.

    Raises `InputError` when a probability lies outside [0, 1], the truth is not boolean, or the lengths differ.

    Parameters
    ----------
    probabilities
        That each target contains an inclusion, shape (targets,), in [0, 1].
    present
        Whether it does, booleans of shape (targets,).
    groups
        Whole numbers of shape (targets,), equal within a group; None groups equal probabilities, which is of little use
        where few are equal.

    Examples
    --------
    >>> parts = brier_score([0.8, 0.8, 0.8, 0.2, 0.2], [True, True, False, False, False])
    >>> round(parts.score, 3), round(parts.reliability, 3), round(parts.resolution, 3), round(parts.uncertainty, 3)
    (0.16, 0.027, 0.107, 0.24)
    """
    values, truth = probabilities_and_truth(probabilities, present)
    together = values if groups is None else np.asarray(groups)
    if together.shape != values.shape:
        raise InputError(f"groups must have one number a target, {len(values)} in all; got shape {together.shape}")
    position = np.unique(together, return_inverse=True)[1]
    sizes = np.bincount(position)
    message, observed = (np.bincount(position, weights=item) / sizes for item in (values, truth.astype(float)))
    fraction = float(truth.mean())
    # Stephenson, Coelho and Jolliffe, Weather Forecast. 23 (2008) 752: variance and covariance inside the groups.
    difference = values - message[position]
    return BrierScore(
        score=float(np.mean((values - truth) ** 2)),
        reliability=float(np.average((message - observed) ** 2, weights=sizes)),
        resolution=float(np.average((observed - fraction) ** 2, weights=sizes)),
        uncertainty=fraction * (1 - fraction),
        within=float(np.mean(difference**2) - 2 * np.mean(difference * (truth - observed[position]))),
    )


def brier_interval(
    probabilities: ArrayLike,
    present: ArrayLike,
    *,
    rng: np.random.Generator,
    level: float = LEVEL,
    draws: int = DRAWS,
    progress: Callable[[int, int], None] | None = None,
) -> Interval:
    """Bootstrap percentile interval of the Brier score; too narrow for few targets.

    Raises `InputError` when the input is invalid, or all squared errors are equal.

    Parameters
    ----------
    probabilities, present
        As for `brier_score`.
    rng, level, draws, progress
        As for `bootstrap_auc`.

    Examples
    --------
    >>> truth = [True, True, False, False, True]
    >>> low, high = brier_interval([0.9, 0.6, 0.3, 0.1, 0.4], truth, rng=np.random.default_rng(0))
    >>> low < 0.126 < high
    True
    """
    values, truth = probabilities_and_truth(probabilities, present)
    checked_level(level)
    draws = checked_draws(rng, draws)
    squares = (values - truth) ** 2
    if np.ptp(squares) == 0:
        raise InputError(
            f"probabilities must miss the truth by unequal amounts for an interval; got {len(squares)} equal squares "
            f"of {squares[0]:g}: add targets"
        )
    drawn = np.empty(draws)
    for start, stop in batches(draws, len(squares), progress):
        picked = rng.multinomial(len(squares), np.full(len(squares), 1 / len(squares)), stop - start)
        drawn[start:stop] = picked @ squares / len(squares)
    return percentiles(drawn, level)


def probabilities_and_truth(probabilities: ArrayLike, present: ArrayLike) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Check probabilities and truth, one of each per target.

    Raises `InputError` when a probability lies outside [0, 1], the truth is not boolean, or the lengths differ.
    """
    values, truth = scored(probabilities, present, name="probabilities")
    outside = (values < 0) | (values > 1)
    if outside.any():
        raise InputError(
            f"probabilities must lie in [0, 1]; got {values[outside][0]:g} among {np.count_nonzero(outside)} outside: "
            "scores of another kind belong into roc"
        )
    return values, truth


BINS = 10
MOST_BINS = 10_000


@dataclass(frozen=True, slots=True, kw_only=True)
class ReliabilityBin:
    """Targets of similar probability.

    Attributes
    ----------
    low, high
        Ends of the bin; a probability at an inner end belongs below it.
    probability
        Mean of the stated probabilities.
    observed
        Proportion of the targets with an inclusion; ``observed.interval()`` is Wilson's.
    """

    low: float
    high: float
    probability: float
    observed: Proportion


@dataclass(frozen=True, slots=True, kw_only=True)
class ReliabilityCurve:
    """Stated probability and observed frequency in each bin that is not empty.

    Attributes
    ----------
    bins
        By rising probability.
    brier
        Brier score with Murphy's parts over these bins.
    """

    bins: tuple[ReliabilityBin, ...]
    brier: BrierScore

    @property
    def expected_calibration_error(self) -> float:
        """Expected calibration error over all targets; few targets per bin raise it even for correct probabilities."""
        weights = [item.observed.trials for item in self.bins]
        return float(np.average([abs(item.probability - item.observed.value) for item in self.bins], weights=weights))


def reliability_curve(
    probabilities: ArrayLike, present: ArrayLike, *, bins: int = BINS, widths: str = "equal-count"
) -> ReliabilityCurve:
    """Compare grouped probabilities with observed frequencies.

    Raises `InputError` when a probability lies outside [0, 1], the truth is not boolean, the lengths differ, or a
    choice is unknown.

    Parameters
    ----------
    probabilities
        That each target holds an inclusion, shape (targets,), in [0, 1].
    present
        Whether it does, booleans of shape (targets,).
    bins
        Number of bins, 1 or more; equal probabilities are in one bin.
    widths
        ``"equal-count"``, ends at quantiles of the probabilities, or ``"equal-width"``.

    Examples
    --------
    >>> curve = reliability_curve([0.1, 0.2, 0.3, 0.7, 0.8, 0.9], [False, False, True, True, True, True], bins=2)
    >>> [(round(one.probability, 2), one.observed.value) for one in curve.bins]
    [(0.2, 0.3333333333333333), (0.8, 1.0)]
    >>> round(curve.expected_calibration_error, 3)
    0.167
    """
    values, truth = probabilities_and_truth(probabilities, present)
    fractions = np.linspace(0.0, 1.0, require_integer("bins", bins, 1, MOST_BINS) + 1)
    widths = choice("widths", widths, ("equal-count", "equal-width"))
    ends = fractions if widths == "equal-width" else np.quantile(values, fractions)
    position = np.searchsorted(ends[1:-1], values)
    results = []
    for index in np.unique(position):
        inside = position == index
        observed = Proportion(successes=int(truth[inside].sum()), trials=int(inside.sum()))
        low, high = float(ends[index]), float(ends[index + 1])
        results.append(ReliabilityBin(low=low, high=high, probability=float(values[inside].mean()), observed=observed))
    return ReliabilityCurve(bins=tuple(results), brier=brier_score(values, truth, groups=position))
