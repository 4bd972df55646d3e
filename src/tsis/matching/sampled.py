"""Matching of point sets too large for tables of all pairs: a sample of both is matched, all points are moved."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree

from tsis.matching.fit import UNMATCHED, MatchFit, moved_in_blocks
from tsis.matching.one_to_one import spacing

if TYPE_CHECKING:
    from numpy.typing import NDArray

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
    moved = moved_in_blocks(fit.move, source)
    matches, trust = mutual_nearest(moved, target)
    return MatchFit(move=fit.move, matches=matches, trust=trust)


def mutual_nearest(
    moved: NDArray[np.float64], target: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Pairs that are each other's nearest within `MUTUAL_RANGE` of the target's spacing, and their trust, shapes (n,)."""
    away, nearest = KDTree(target).query(moved)
    _, back = KDTree(moved).query(target)
    reach = MUTUAL_RANGE * spacing(target)
    found = (np.asarray(back)[nearest] == np.arange(len(moved))) & (away <= reach)
    matches = np.where(found, nearest, UNMATCHED).astype(np.int64)
    return matches, np.where(found, 1 - away / reach / 2, 0.0)
