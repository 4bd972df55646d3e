"""Robust point matching with thin-plate splines by deterministic annealing (Chui and Rangarajan 2003)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.matching._annealing import START, Cooling, anneal
from tsis.matching._fit import Floats, MatchFit
from tsis.matching._pairing import nearest_pairs, spacing
from tsis.matching._spline import spline_basis, spread_out

if TYPE_CHECKING:
    import numpy as np


FACTOR = 0.9
ROUNDS = 4
COLDEST = 0.35  # last standard deviation, of the distance between neighbours
CONTROL_POINTS = 150


def fit(source: Floats, target: Floats, /, *, rng: np.random.Generator) -> MatchFit:
    """Match normalised points, shapes (n, d) and (m, d), by annealing, which is deterministic."""
    del rng
    basis = spline_basis(source, control=spread_out(source, CONTROL_POINTS))
    step = max(spacing(source), spacing(target))
    cooling = Cooling(factor=FACTOR, start=START, end=(COLDEST * step) ** 2, rounds=ROUNDS)
    coordinates = anneal(basis, basis.rest, target, cooling)
    matches, trust = nearest_pairs(basis.design @ coordinates, target, tolerance=step)
    return MatchFit(move=basis.spline(coordinates), matches=matches, trust=trust)
