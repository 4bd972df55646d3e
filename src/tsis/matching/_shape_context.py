"""Matching by shape contexts (Belongie, Malik and Puzicha 2002).

Each round compares the shape contexts, assigns pairs at the least total cost with some points unmatched, and fits a
thin-plate spline with less bending ridge than the round before.
"""

from __future__ import annotations

import numpy as np

from tsis.matching._fit import UNMATCHED, Floats, Integers, MatchFit
from tsis.matching._log_polar import axis_histograms, chi_squared, histograms
from tsis.matching._pairing import assign
from tsis.matching._spline import spline_basis

ROUNDS = 6
NO_PARTNER_DISTANCE = 0.25  # chi-squared distance beyond which a pair is rejected,
SPARED = 0.75  # except for this best fraction: the contexts of rotated or noisy points all differ
BENDING = 3.0  # of the first round
SOFTENING = 0.5  # of the bending, from round to round


def fit(source: Floats, target: Floats, /, *, rng: np.random.Generator, rotated: bool = False) -> MatchFit:
    """Match normalised points, shapes (n, d) and (m, d), by their shape contexts; the method is deterministic.

    With ``rotated``, directions are measured from the mass centre. The sets may then be rotated by any angle, but the
    contexts discriminate less and change with the mass centre.
    """
    del rng
    describe = axis_histograms if rotated else histograms
    target_contexts, basis = describe(target), spline_basis(source)
    transformed = source
    for number in range(ROUNDS):
        cost = chi_squared(describe(transformed), target_contexts)
        matches = _matches(cost)
        paired = matches != UNMATCHED
        coordinates = basis.coordinates(
            np.where(paired[:, None], target[matches], 0.0),
            bending=BENDING * SOFTENING**number,
            weights=paired.astype(float),
        )
        transformed = basis.design @ coordinates
    correlation = 1 - np.minimum(cost[np.arange(len(source)), matches], 1.0)  # above 1 only by rounding
    return MatchFit(move=basis.spline(coordinates), matches=matches, trust=np.where(paired, correlation, 0.0))


def _matches(cost: Floats) -> Integers:
    """Cheapest pairs of all points of the smaller set, less those beyond the limit of the distance."""
    matches = assign(cost, dummy=np.inf)
    paid = np.where(matches == UNMATCHED, np.inf, cost[np.arange(len(cost)), matches])
    limit = max(NO_PARTNER_DISTANCE, float(np.quantile(paid[np.isfinite(paid)], SPARED)))
    return np.where(paid <= limit, matches, UNMATCHED)
