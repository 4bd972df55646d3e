"""Matching of point sets too large for tables of all pairs: a sample of both is matched, all points are moved."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree

from tsis.matching.fit import UNMATCHED, Fit
from tsis.matching.one_to_one import spacing

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.matching.fit import Method

MOST_PAIRS = 16_000_000  # 128 MB a table; a method holds a few of them
SAMPLE = 2000  # points of the source; of the target, as many as a table of all pairs has room for
MOST_POINTS = 2_000_000
REACH = 0.5  # of the target's spacing, up to which a moved point has found its partner
BLOCK = 20_000


def is_large(source: NDArray[np.float64], target: NDArray[np.float64]) -> bool:
    """Whether a table of all pairs would not fit."""
    return len(source) * len(target) > MOST_PAIRS


def match_sample(
    method: Method, source: NDArray[np.float64], target: NDArray[np.float64], *, rng: np.random.Generator
) -> tuple[Fit, str]:
    """Match a sample of normalised points, shapes (n, d) and (m, d), and say so.

    More of the target are drawn, so that most points drawn of the source have their partners among them, up to some
    8000 points; where fewer have, the outlines and densities must do. What is found is the map; the matches are then
    read off it, between moved source points and target points that are each other's nearest.
    """
    counts = (SAMPLE, MOST_PAIRS // SAMPLE)
    fewer = [
        one[np.sort(rng.permutation(len(one))[:count])] for one, count in zip((source, target), counts, strict=True)
    ]
    fit = method(fewer[0], fewer[1], rng=rng)
    moved = np.concatenate([fit.move(source[start : start + BLOCK]) for start in range(0, len(source), BLOCK)])
    matches, trust = mutual_nearest(moved, target)
    note = (
        f"{len(source):,} and {len(target):,} points are too many for tables of all pairs; "
        f"{len(fewer[0]):,} and {len(fewer[1]):,} drawn from them were matched, and all were moved"
    )
    return Fit(move=fit.move, matches=matches, trust=trust), note


def mutual_nearest(
    moved: NDArray[np.float64], target: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Pairs that are each other's nearest within `REACH` of the target's spacing, and their trust, shapes (n,)."""
    away, nearest = KDTree(target).query(moved)
    _, back = KDTree(moved).query(target)
    reach = REACH * spacing(target)
    found = (np.asarray(back)[nearest] == np.arange(len(moved))) & (away <= reach)
    matches = np.where(found, nearest, UNMATCHED).astype(np.int64)
    return matches, np.where(found, 1 - away / reach / 2, 0.0)
