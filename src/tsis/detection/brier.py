"""How good probabilities are: the Brier score and the parts that Murphy takes it apart into."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.detection.bootstrap import DRAWS, batches, checked_draws, percentiles
from tsis.detection.inputs import scored
from tsis.detection.interval import LEVEL, Interval, checked_level
from tsis.model.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class BrierScore:
    """Mean square of probability less truth, 0 at best, with its parts.

    ``score = reliability - resolution + uncertainty + within``.

    Attributes
    ----------
    score
        In [0, 1].
    reliability
        Mean square by which the probability of a group misses its share of inclusions; 0 is best.
    resolution
        Mean square by which the shares of groups differ from that of all; larger is better.
    uncertainty
        Score of who always says the share of all.
    within
        What is lost by taking probabilities that differ for one group; 0 where each probability is its own.
    """

    score: float
    reliability: float
    resolution: float
    uncertainty: float
    within: float


def brier_score(probabilities: ArrayLike, present: ArrayLike, *, groups: ArrayLike | None = None) -> BrierScore:
    """Brier score of probabilities, in Murphy's parts.

    Parameters
    ----------
    probabilities
        That each target holds an inclusion, shape (targets,), in [0, 1].
    present
        Whether it does, booleans of shape (targets,).
    groups
        Whole numbers of shape (targets,), equal where targets belong together; None groups equal probabilities, which
        says little where hardly two are equal.

    Raises
    ------
    InputError
        When a probability is none, the truth no booleans, or the lengths differ.

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
    place = np.unique(together, return_inverse=True)[1]
    sizes = np.bincount(place)
    said, seen = (np.bincount(place, weights=one) / sizes for one in (values, truth.astype(float)))
    share = float(truth.mean())
    # Stephenson, Coelho and Jolliffe, Weather Forecast. 23 (2008) 752: variance and covariance inside the groups.
    apart = values - said[place]
    return BrierScore(
        score=float(np.mean((values - truth) ** 2)),
        reliability=float(np.average((said - seen) ** 2, weights=sizes)),
        resolution=float(np.average((seen - share) ** 2, weights=sizes)),
        uncertainty=share * (1 - share),
        within=float(np.mean(apart**2) - 2 * np.mean(apart * (truth - seen[place]))),
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
    """Percentile interval of the Brier score from targets drawn anew; too narrow where they are few.

    Parameters
    ----------
    probabilities, present
        As for `brier_score`.
    rng
        Source of the draws.
    level
        Confidence, in (0, 1).
    draws
        How many studies are drawn, 100 or more.
    progress
        Called with (done, total) after each batch.

    Raises
    ------
    InputError
        When the input is bad, or all targets miss by as much, which says nothing of the spread.

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
    for start, stop in batches(draws, len(squares)):
        picked = rng.multinomial(len(squares), np.full(len(squares), 1 / len(squares)), stop - start)
        drawn[start:stop] = picked @ squares / len(squares)
        if progress is not None:
            progress(stop, draws)
    return percentiles(drawn, level)


def probabilities_and_truth(probabilities: ArrayLike, present: ArrayLike) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Return checked probabilities and truth, one of each a target.

    Raises
    ------
    InputError
        When a probability lies outside [0, 1], the truth is no booleans, or the lengths differ.
    """
    values, truth = scored(probabilities, present, name="probabilities")
    outside = (values < 0) | (values > 1)
    if outside.any():
        raise InputError(
            f"probabilities must lie in [0, 1]; got {values[outside][0]:g} among {np.count_nonzero(outside)} outside: "
            "scores of another kind belong into roc"
        )
    return values, truth


__all__ = ["BrierScore", "brier_interval", "brier_score", "probabilities_and_truth"]
