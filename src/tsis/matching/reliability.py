"""How far an answer can be relied on, whatever method gave it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.matching.evidence import log_evidence
from tsis.matching.fit import UNMATCHED
from tsis.matching.spline import far_apart, spline_basis

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.matching.fit import MatchFit

RELIABLE = 0.5
SCALE = 3.0  # of log evidence, in which confidence grows from a quarter to three
MOST = 600  # points of each set that are looked at
PASSING = 1e-6  # bending that is held back when the spline is read back from the moved points


def confidence_of(fit: MatchFit, source: NDArray[np.float64], target: NDArray[np.float64]) -> float:
    """Confidence in [0, 1] that an answer says more than chance: from the evidence for it, over that for no relation.

    No relation is the likelier of points spread evenly and one normal cloud; the map pays for its affine part.

    A wrong answer that explains much, as half of a shape that lies on another, is not told from a right one.

    Parameters
    ----------
    fit
        What a method found.
    source, target
        The normalised points that it was given.
    """
    dimension = source.shape[1]
    if np.count_nonzero(fit.matches != UNMATCHED) < dimension + 2:
        return 0.0
    seen = source[far_apart(source, MOST)] if len(source) > MOST else source
    there = target[far_apart(target, MOST)] if len(target) > MOST else target
    basis = spline_basis(seen)
    coordinates = basis.coordinates(fit.move(seen), bending=PASSING)
    for_it = log_evidence(basis, coordinates, there) - _price_of_a_pose(there) - _normal_over_even(there)
    return float(1 / (1 + np.exp(np.clip(-for_it / SCALE, -50, 50))))


def _price_of_a_pose(target: NDArray[np.float64]) -> float:
    """What an affine map fitted to the points gains where there is none (Schwarz's criterion)."""
    dimension = target.shape[1]
    return float(0.5 * dimension * (dimension + 1) * np.log(target.size))


def _normal_over_even(target: NDArray[np.float64]) -> float:
    """Log probability of the points as one normal cloud, over that of points spread evenly in their box; at least 0."""
    count, dimension = target.shape
    _, volume = np.linalg.slogdet(np.cov(target, rowvar=False, bias=True))
    box = float(np.log(np.ptp(target, axis=0)).sum())
    return float(max(0.0, count * (box - 0.5 * (dimension * np.log(2 * np.pi * np.e) + volume))))
