"""Topology-preserving relaxation labelling, corrected: pose by labelled neighbourhoods, then pairs that harden."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.distance import cdist

from tsis.matching.annealing import START, Cooling, anneal
from tsis.matching.evidence import log_evidence
from tsis.matching.fit import UNMATCHED, Fit
from tsis.matching.one_to_one import assign, nearest_pairs, spacing
from tsis.matching.poses import poses
from tsis.matching.spline import spline_basis

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.matching.spline import SplineBasis

FACTOR, ROUNDS = 0.85, 3
COLDEST = 0.35
WARM = 0.15
TRIED = 2


def fit(source: NDArray[np.float64], target: NDArray[np.float64], /, *, rng: np.random.Generator) -> Fit:
    basis = spline_basis(source)
    step = max(spacing(source), spacing(target))
    end = (COLDEST * step) ** 2
    best, most = basis.rest, -np.inf
    starts = []
    for pose in poses(source, target, rng=rng)[:TRIED]:
        coordinates = np.zeros_like(basis.rest)
        coordinates[basis.bent :] = pose.affine
        starts.append((coordinates, WARM))
    starts.append((basis.rest, START))
    for coordinates, warm in starts:
        found = anneal(basis, coordinates, target, Cooling(factor=FACTOR, start=warm, end=end, rounds=ROUNDS))
        for one in (found, _assigned(basis, found, target, step)):
            evidence = log_evidence(basis, one, target)
            if evidence > most:
                best, most = one, evidence
    moved = basis.design @ best
    matches, trust = nearest_pairs(moved, target, tolerance=step)
    return Fit(move=basis.spline(best), matches=matches, trust=trust)


def _assigned(basis, coordinates, target, step):
    for reach in (0.5, 0.35, 0.25, 0.2, 0.15, 0.1):
        moved = basis.design @ coordinates
        squared = cdist(moved, target, "sqeuclidean")
        pairs = assign(squared, dummy=max(reach, 1.5 * step) ** 2)
        paired = pairs != UNMATCHED
        if paired.sum() < 4:
            return coordinates
        away = squared[paired, pairs[paired]]
        variance = max(float(np.median(away)) / 1.4, 1e-6)
        coordinates = basis.coordinates(np.where(paired[:, None], target[pairs], moved), bending=max(variance, 1e-4) / 0.01, weights=paired + 1e-9)
    return coordinates
