"""Robust point matching with thin-plate splines (Chui and Rangarajan 2003): soft pairs that harden as they cool.

At a temperature T (a squared length) pairs are weighed by ``exp(-|y - f(x)|**2 / 2T) / T``, beside an outlier of each
set as wide as the points at the start; alternating normalisation makes the weights of every point sum to one. The
spline follows the weighed targets, held back by ``BENDING T`` and its affine part by ``TURNING T`` times the number of
points, and T falls by `COOLING` a step.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial.distance import cdist

from tsis.matching.fit import Fit
from tsis.matching.one_to_one import nearest_pairs, spacing
from tsis.matching.spline import spline_basis, spread_out

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.matching.spline import SplineBasis

START = 3.0  # temperature, in squared root-mean-square radii: half a unit box's, whose side is 2.45 of them
COOLING = 0.93
COLDEST = 0.35  # end of the cooling: standard deviation, of the distance between neighbours
ALTERNATIONS = 5  # at each temperature, unless
SETTLED = 0.03  # no point moved by so much of a standard deviation
BENDING = 1.0
TURNING = 0.3  # published as 0.01; with more, more of the deformed, cluttered and occluded public shapes are found
CONTROL_POINTS = 150
BALANCED = 1e-2  # to which the weights of a point sum to one; the next round goes on from there
BALANCINGS = 50


def fit(source: NDArray[np.float64], target: NDArray[np.float64], /, *, rng: np.random.Generator) -> Fit:
    """Match normalised points, shapes (n, d) and (m, d), by cooling soft pairs; nothing in it is left to chance."""
    del rng
    basis = spline_basis(source, control=spread_out(source, CONTROL_POINTS))
    coordinates = np.zeros((basis.design.shape[1], source.shape[1]))
    coordinates[basis.bent + 1 :] = np.eye(source.shape[1])
    moved, balance = source, np.ones(len(target))
    step = max(spacing(source), spacing(target))
    temperature, coldest = START, (COLDEST * step) ** 2
    while temperature > coldest:
        for _ in range(ALTERNATIONS):
            weights, balance = soft_pairs(moved, target, temperature, balance)
            coordinates = _follow(basis, weights, target, temperature)
            before, moved = moved, basis.design @ coordinates
            if np.max((moved - before) ** 2) < SETTLED**2 * temperature:
                break
        temperature *= COOLING
    matches, trust = nearest_pairs(moved, target, tolerance=step)
    return Fit(move=basis.spline(coordinates), matches=matches, trust=trust)


def soft_pairs(
    moved: NDArray[np.float64], target: NDArray[np.float64], temperature: float, balance: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Weights of the pairs, shape (n, m), rows and columns with the outlier's share each summing to one.

    Parameters
    ----------
    moved, target
        Shapes (n, d) and (m, d).
    temperature
        T, positive.
    balance
        Factors of the columns to start with, shape (m,): those of a temperature little different save most of the work.

    Returns
    -------
    weights
        Shape (n, m).
    balance
        Factors of the columns, shape (m,).
    """
    near = np.exp(cdist(moved, target, "sqeuclidean") / (-2 * temperature)) / temperature
    alone, stray = outlier_weights(moved), outlier_weights(target)
    for _ in range(BALANCINGS):
        rows = 1 / (near @ balance + alone)
        before, balance = balance, 1 / (rows @ near + stray)
        if np.max(np.abs(balance / before - 1)) < BALANCED:
            break
    return rows[:, None] * near * balance, balance


def plain_soft_pairs(
    moved: NDArray[np.float64], target: NDArray[np.float64], temperature: float, *, balancings: int = 2000
) -> NDArray[np.float64]:
    """What `soft_pairs` computes, on the whole matrix with the outliers' row and column."""
    weights = np.zeros((len(moved) + 1, len(target) + 1))
    weights[:-1, :-1] = np.exp(-cdist(moved, target, "sqeuclidean") / (2 * temperature)) / temperature
    weights[:-1, -1], weights[-1, :-1] = outlier_weights(moved), outlier_weights(target)
    for _ in range(balancings):
        weights[:-1] /= weights[:-1].sum(axis=1, keepdims=True)
        weights[:, :-1] /= weights[:, :-1].sum(axis=0, keepdims=True)
    return weights[:-1, :-1]


def outlier_weights(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weight of having no partner, shape (n,): a Gaussian about the mass centre at the starting temperature."""
    away = np.sum((points - points.mean(axis=0)) ** 2, axis=1)
    return np.asarray(np.exp(-away / (2 * START)) / START)


def _follow(
    basis: SplineBasis, weights: NDArray[np.float64], target: NDArray[np.float64], temperature: float
) -> NDArray[np.float64]:
    """Coordinates of the spline that follows the weighed targets, near to rest as far as the temperature holds it."""
    paired = weights.sum(axis=1)
    normal = basis.design.T @ (paired[:, None] * basis.design)
    right = basis.design.T @ (weights @ target)
    hold = temperature * len(weights)
    ridge = np.full(len(normal), BENDING * hold)
    ridge[basis.bent] = 1e-12 * hold  # the translation is free, but for no weight at all
    ridge[basis.bent + 1 :] = TURNING * hold
    right[basis.bent + 1 :] += np.diag(ridge[basis.bent + 1 :])
    normal[np.diag_indices_from(normal)] += ridge
    return np.asarray(cho_solve(cho_factor(normal, check_finite=False), right, check_finite=False))
