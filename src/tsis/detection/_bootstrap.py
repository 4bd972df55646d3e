"""Stratified bootstrap: targets of a study resampled with replacement within their class."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.detection._inputs import LEVEL, Interval, both_classes, checked_level, scored
from tsis.errors import InputError
from tsis.model import require_integer

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import ArrayLike, NDArray


DRAWS = 2000
MOST_DRAWS = 10**7
AT_ONCE = 2**20  # numbers of one batch of draws


def bootstrap_auc(
    scores: ArrayLike,
    present: ArrayLike,
    *,
    rng: np.random.Generator,
    level: float = LEVEL,
    draws: int = DRAWS,
    progress: Callable[[int, int], None] | None = None,
) -> Interval:
    """Percentile interval of an area under the curve from the stratified bootstrap.

    Raises `InputError` when the input is invalid, a class is missing, or all draws have the same area.

    Parameters
    ----------
    scores, present
        As for `tsis.detection._roc`.
    rng
        Source of the draws.
    level
        Confidence, in (0, 1).
    draws
        How many studies are drawn, 100 or more.
    progress
        Called with (done, total) after each batch.

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
    positions = [_resampled_indices(row[present], row[~present]) for row in scores]
    result = np.empty((draws, len(scores)))
    for start, stop in batches(draws, m + n, progress):
        inside = rng.multinomial(m, np.full(m, 1 / m), stop - start)
        outside = rng.multinomial(n, np.full(n, 1 / n), stop - start)
        for index, (order, left, right) in enumerate(positions):
            below = np.zeros((stop - start, n + 1), dtype=np.int64)
            np.cumsum(outside[:, order], axis=1, out=below[:, 1:])
            right_pairs = (inside * (below[:, left] + below[:, right])).sum(axis=1)
            result[start:stop, index] = right_pairs / (2 * m * n)
    return result


def percentiles(drawn: NDArray[np.float64], level: float) -> Interval:
    """Percentile interval of the draws."""
    low, high = np.quantile(drawn, [(1 - level) / 2, (1 + level) / 2])
    return Interval(low=float(low), high=float(high), level=level, method="bootstrap")


def _resampled_indices(
    inside: NDArray[np.float64], outside: NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Order of the targets without inclusion, and the numbers of them below, and not above, each target with."""
    order = np.argsort(outside)
    ranked = outside[order]
    return order, np.searchsorted(ranked, inside, "left"), np.searchsorted(ranked, inside, "right")


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
