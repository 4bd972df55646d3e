"""Topology-preserving relaxation labelling, corrected: the likeliest of many poses, with a smooth field about it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.distance import cdist

from tsis.matching._fit import UNMATCHED, Floats, MatchFit
from tsis.matching._pairing import assign, nearest_pairs
from tsis.matching._posterior import pose_posterior
from tsis.matching._spline import spline_basis

if TYPE_CHECKING:
    from tsis.matching._posterior import PosePosterior
    from tsis.matching._spline import ThinPlateSpline

NEAREST = 1.5  # largest distance of a pair, in spacings
CERTAIN_DISTANCE = 0.2  # root-mean-square distance of partners, of the spacing, below which pairs are unambiguous
INTERPOLATING = 1e-7  # bending ridge of a spline through unambiguous partners


def fit(
    source: Floats, target: Floats, /, *, rng: np.random.Generator, posterior: PosePosterior | None = None
) -> MatchFit:
    """Match normalised points, shapes (n, d) and (m, d); ``rng`` draws the samples of the pose consensus.

    A ``posterior`` of the same sets saves the search.
    """
    posterior = pose_posterior(source, target, rng=rng) if posterior is None else posterior
    best = posterior.best
    if best is None:
        return MatchFit(move=np.copy, matches=np.full(len(source), UNMATCHED), trust=np.zeros(len(source)))
    move = _interpolated(source, best.moved, target, posterior.search.step) or posterior.move(best)
    matches, trust = nearest_pairs(move(source), target, tolerance=posterior.search.step)
    return MatchFit(move=move, matches=matches, trust=trust)


def _interpolated(source: Floats, moved: Floats, target: Floats, spacing: float) -> ThinPlateSpline | None:
    """The spline through the partners of moved points where these are unambiguous.

    A residual is noise or fine deformation, which the points do not distinguish. Where it is small against the spacing,
    the partner is the better estimate of the position.
    """
    squared = cdist(moved, target, "sqeuclidean")
    pairs = assign(squared, dummy=(NEAREST * spacing) ** 2)
    rows = np.flatnonzero(pairs != UNMATCHED)
    away = squared[rows, pairs[rows]]
    if len(rows) <= source.shape[1] or np.mean(away) > (CERTAIN_DISTANCE * spacing) ** 2:
        return None
    basis = spline_basis(source)
    return basis.spline(basis.at(rows).coordinates(target[pairs[rows]], bending=INTERPOLATING))
