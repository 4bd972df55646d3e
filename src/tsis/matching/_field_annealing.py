"""Annealing of a smooth field: soft pairs at falling standard deviations, from one starting map each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.compiled import fused

if TYPE_CHECKING:
    from tsis.matching._fit import Floats

NO_PARTNER = 3.0  # standard deviations: an unmatched point is as likely as a partner at that distance
BALANCINGS = 3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AnnealedMap:
    """Coordinates of a map, shape (k, d), and its penalised log likelihood at the last standard deviation."""

    coordinates: Floats
    score: float


def annealed_map(
    design: Floats, ridge: Floats, target: Floats, start: Floats, sigmas: Floats, *, rounds: int = 1
) -> AnnealedMap:
    """Alternate soft pairs at falling ``sigmas`` and ridge regression on ``design``, shape (n, k), from ``start``.

    The ridge, shape (k,), is the inverse prior variance of each coordinate about its start.
    """
    coordinates, score = _annealed(design, ridge, target, np.ascontiguousarray(start), sigmas, rounds)
    return AnnealedMap(coordinates=coordinates, score=score)


@fused
def balanced_pairs(moved: Floats, target: Floats, sigma: float, rounds: int) -> Floats:
    """Soft pairs, shape (n, m), whose rows and columns sum to at most about one."""
    n, dimension = moved.shape
    m = len(target)
    near = np.empty((n, m))
    alone = np.exp(-0.5 * NO_PARTNER**2)
    rows, columns = np.ones(n), np.ones(m)
    scale = -0.5 / sigma**2
    for i in range(n):
        for j in range(m):
            away = 0.0
            for axis in range(dimension):
                away += (moved[i, axis] - target[j, axis]) ** 2
            near[i, j] = np.exp(scale * away) if scale * away > -12.0 else 0.0
    for _ in range(rounds):
        totals = np.full(m, alone)
        for i in range(n):
            total = alone
            for j in range(m):
                total += near[i, j] * columns[j]
            rows[i] = 1 / total
            for j in range(m):
                totals[j] += near[i, j] * rows[i]
        for j in range(m):
            columns[j] = 1 / totals[j]
    for i in range(n):
        for j in range(m):
            near[i, j] *= rows[i] * columns[j]
    return near


@fused
def _annealed(
    design: Floats, ridge: Floats, target: Floats, start: Floats, sigmas: Floats, rounds: int
) -> tuple[Floats, float]:
    n, k = design.shape
    dimension = target.shape[1]
    coordinates = start.copy()
    weighted = np.empty((n, k))
    for sigma in sigmas:
        for _ in range(rounds):
            pairs = balanced_pairs(np.ascontiguousarray(design @ coordinates), target, sigma, BALANCINGS)
            drawn = pairs @ target
            for i in range(n):
                paired = pairs[i].sum()
                for c in range(k):
                    weighted[i, c] = design[i, c] * paired
            normal = weighted.T @ design
            right = design.T @ drawn
            for c in range(k):
                normal[c, c] += ridge[c] * sigma**2
                for axis in range(dimension):
                    right[c, axis] += ridge[c] * sigma**2 * start[c, axis]
            coordinates = np.ascontiguousarray(np.linalg.solve(normal, right))
    moved = np.ascontiguousarray(design @ coordinates)
    return coordinates, _score(moved, target, sigmas[-1], ridge, coordinates, start)


@fused
def _score(moved: Floats, target: Floats, sigma: float, ridge: Floats, coordinates: Floats, start: Floats) -> float:
    score = 0.0
    for j in range(len(target)):
        total = np.exp(-0.5 * NO_PARTNER**2)
        for i in range(len(moved)):
            away = 0.0
            for axis in range(target.shape[1]):
                away += (moved[i, axis] - target[j, axis]) ** 2
            total += np.exp(-0.5 * away / sigma**2)
        score += np.log(total)
    for c in range(len(ridge)):
        for axis in range(target.shape[1]):
            score -= 0.5 * ridge[c] * (coordinates[c, axis] - start[c, axis]) ** 2
    return score
