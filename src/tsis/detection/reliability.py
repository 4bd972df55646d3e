"""Probabilities beside what was there: of those that say 70 %, are 70 % so?"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.detection.brier import brier_score, probabilities_and_truth
from tsis.detection.inputs import choice
from tsis.detection.proportion import Proportion
from tsis.model.check import require_integer

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from tsis.detection.brier import BrierScore

BINS = 10
MOST_BINS = 10_000


@dataclass(frozen=True, slots=True, kw_only=True)
class ReliabilityBin:
    """Targets of like probability.

    Attributes
    ----------
    low, high
        Ends of the bin; a probability at an inner end belongs below it.
    probability
        Mean of those said.
    observed
        How many of the targets held an inclusion; ``observed.interval()`` is Wilson's.
    """

    low: float
    high: float
    probability: float
    observed: Proportion


@dataclass(frozen=True, slots=True, kw_only=True)
class ReliabilityCurve:
    """Said and seen, bin by bin, without those that hold no target.

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
        """Mean distance of said and seen over all targets; few targets a bin raise it even where all is right."""
        weights = [one.observed.trials for one in self.bins]
        return float(np.average([abs(one.probability - one.observed.value) for one in self.bins], weights=weights))


def reliability_curve(
    probabilities: ArrayLike, present: ArrayLike, *, bins: int = BINS, widths: str = "equal-count"
) -> ReliabilityCurve:
    """Group probabilities and set them beside the shares that came true.

    Parameters
    ----------
    probabilities
        That each target holds an inclusion, shape (targets,), in [0, 1].
    present
        Whether it does, booleans of shape (targets,).
    bins
        How many, 1 or more; equal probabilities are never parted.
    widths
        ``"equal-count"``, ends at quantiles of the probabilities, or ``"equal-width"``.

    Raises
    ------
    InputError
        When a probability is none, the truth no booleans, the lengths differ, or a choice is unknown.

    Examples
    --------
    >>> curve = reliability_curve([0.1, 0.2, 0.3, 0.7, 0.8, 0.9], [False, False, True, True, True, True], bins=2)
    >>> [(round(one.probability, 2), one.observed.value) for one in curve.bins]
    [(0.2, 0.3333333333333333), (0.8, 1.0)]
    >>> round(curve.expected_calibration_error, 3)
    0.167
    """
    values, truth = probabilities_and_truth(probabilities, present)
    shares = np.linspace(0.0, 1.0, require_integer("bins", bins, 1, MOST_BINS) + 1)
    widths = choice("widths", widths, ("equal-count", "equal-width"))
    ends = shares if widths == "equal-width" else np.quantile(values, shares)
    place = np.searchsorted(ends[1:-1], values)
    found = []
    for index in np.unique(place):
        inside = place == index
        observed = Proportion(successes=int(truth[inside].sum()), trials=int(inside.sum()))
        low, high = float(ends[index]), float(ends[index + 1])
        found.append(ReliabilityBin(low=low, high=high, probability=float(values[inside].mean()), observed=observed))
    return ReliabilityCurve(bins=tuple(found), brier=brier_score(values, truth, groups=place))


__all__ = ["ReliabilityBin", "ReliabilityCurve", "reliability_curve"]
