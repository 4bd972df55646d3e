"""Pairs from costs: each point at most once, none where having no partner is cheaper."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import KDTree
from scipy.spatial.distance import cdist

from tsis.matching._fit import UNMATCHED, MatchFit, transformed_in_blocks

if TYPE_CHECKING:
    from numpy.typing import NDArray


TOLERANCE_SD = 3.0  # standard deviations of a point's place that the tolerance stands for


def nearest_pairs(
    transformed: NDArray[np.float64], target: NDArray[np.float64], *, tolerance: float
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Which target point each moved point has reached, the squared distances together being the least possible.

    Parameters
    ----------
    transformed, target
        Shapes (n, d) and (m, d), in the same unit.
    tolerance
        Distance beyond which points have no partner, positive, in that unit.

    Returns
    -------
    matches
        Index of the target point, or `UNMATCHED`, shape (n,); no target point twice.
    trust
        Chance of the match among all targets and none, were places normal with a standard deviation of a third of the
        tolerance and having no partner as likely as one at the tolerance; 0 where there is no match; shape (n,).

    Examples
    --------
    >>> matches, _ = nearest_pairs(np.array([[0.0], [5.0]]), np.array([[9.0], [0.1]]), tolerance=1.0)
    >>> matches.tolist()
    [1, -1]
    """
    squared = cdist(transformed, target, "sqeuclidean")
    matches = assign(squared, dummy=tolerance**2)
    likely = np.exp(-0.5 * squared * (TOLERANCE_SD / tolerance) ** 2)
    chance = likely / (likely.sum(axis=1, keepdims=True) + np.exp(-0.5 * TOLERANCE_SD**2))
    return matches, np.where(matches == UNMATCHED, 0.0, chance[np.arange(len(matches)), matches])


def assign(cost: NDArray[np.float64], *, dummy: float) -> NDArray[np.int64]:
    """Cheapest pairing of rows with columns, shape (n, m), where every point may stay alone.

    A pair is made only where it costs less than ``dummy``, which is what a row without a column costs. Returns the
    column of each row, or `UNMATCHED`, shape (n,).

    Examples
    --------
    >>> assign(np.array([[1.0, 2.0], [1.1, 9.0]]), dummy=5.0).tolist()
    [1, 0]
    """
    # A pair that costs no less than none is none: it need not be told apart from the others like it.
    rows, columns = linear_sum_assignment(np.minimum(cost, dummy))
    matches = np.full(len(cost), UNMATCHED, dtype=np.int64)
    cheap = cost[rows, columns] < dummy
    matches[rows[cheap]] = columns[cheap]
    return matches


def spacing(points: NDArray[np.float64]) -> float:
    """Median distance of the points, shape (n, d), to the nearest one elsewhere; 0 where there is none."""
    positions = np.unique(points, axis=0)
    distance, _ = KDTree(positions).query(positions, k=[2])
    return float(np.median(distance)) if len(positions) > 1 else 0.0


MOST_PAIRS = 16_000_000  # 128 MB a table; a method holds a few of them
SAMPLE = 2000  # points of the source; of the target, as many as a table of all pairs has room for
MOST_POINTS = 2_000_000
MUTUAL_RANGE = 0.5  # of the target's spacing, up to which a moved point has found its partner


def drawn(
    source: NDArray[np.float64], target: NDArray[np.float64], *, rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Samples of two normalised sets, shapes (n, d) and (m, d), whose table has room; the sets where theirs has.

    More of the target are drawn, so that most points drawn of the source have their partners among them, up to some
    8000 points; where fewer have, the outlines and densities must do.
    """
    if len(source) * len(target) <= MOST_PAIRS:
        return source, target

    def some(points: NDArray[np.float64], count: int) -> NDArray[np.float64]:
        return points[np.sort(rng.permutation(len(points))[:count])]

    return some(source, SAMPLE), some(target, MOST_PAIRS // SAMPLE)


def matched_all(fit: MatchFit, source: NDArray[np.float64], target: NDArray[np.float64]) -> MatchFit:
    """The fit of samples, with matches of all normalised points, shapes (n, d) and (m, d).

    What samples tell is the map. The matches are read off it, between moved source points and target points that are
    each other's nearest.
    """
    transformed = transformed_in_blocks(fit.move, source)
    matches, trust = mutual_nearest(transformed, target)
    return MatchFit(move=fit.move, matches=matches, trust=trust)


def mutual_nearest(
    transformed: NDArray[np.float64], target: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Mutual nearest neighbours within `MUTUAL_RANGE` of the target's spacing, and their weights, shapes (n,)."""
    away, nearest = KDTree(target).query(transformed)
    _, back = KDTree(transformed).query(target)
    extent = MUTUAL_RANGE * spacing(target)
    result = (np.asarray(back)[nearest] == np.arange(len(transformed))) & (away <= extent)
    matches = np.where(result, nearest, UNMATCHED).astype(np.int64)
    return matches, np.where(result, 1 - away / extent / 2, 0.0)
