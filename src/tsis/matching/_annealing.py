"""Soft pairs that harden as they cool, and the spline that follows them (Chui and Rangarajan 2003).

At a temperature T (a squared length) pairs are weighed by ``exp(-|y - f(x)|**2 / 2T) / T``, beside an outlier of each
set as wide as the points at the start; alternating normalisation (Sinkhorn) makes the weights of every point, its
outlier's among them, sum to one. The spline follows the weighed targets; its bending is held back by ``BENDING T``, and
its affine part, to where it began, by ``TURNING T``, both times the number of points. Then T falls.

Nobody needs the weights themselves: only their sum a source point, and the sum of the targets that they weigh. Pairs
farther apart than `CUT_OFF` are left out, and where points are many the first temperatures, which see nothing fine, are
passed on samples of them, the larger the cooler: each point then always has a few pairs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.distance import cdist

from tsis.compiled import fused
from tsis.matching._fit import ridge_solution
from tsis.matching._spline import spread_order

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.matching._spline import SplineBasis


START = 3.0  # temperature, in squared root-mean-square radii: half a unit box's, whose side is 2.45 of them
BENDING = 1.0
TURNING = 0.3  # published as 0.01; with more, more of the deformed, cluttered and occluded shapes are found
SETTLED = 0.03  # a round ends when no point moved by so much of a standard deviation
BALANCED = 1e-2  # to which the weights of a point sum to one; the next round goes on from there
BALANCINGS = 10
CUT_OFF = 24.0  # of T, squared distance beyond which exp(-12) counts as nothing
COARSE = (120, 350)  # points of source and target in the first temperatures, of sets that have more
FINE = 0.5  # of the spacing of the target's points that take part: the standard deviation falls no farther below it


@dataclass(frozen=True, slots=True, kw_only=True)
class Cooling:
    """How temperatures fall: by a factor, from one to another, with at most so many rounds at each."""

    factor: float
    start: float
    end: float
    rounds: int


def anneal(
    basis: SplineBasis, coordinates: NDArray[np.float64], target: NDArray[np.float64], cooling: Cooling
) -> NDArray[np.float64]:
    """Coordinates of the spline after cooling, shape (k, d).

    Parameters
    ----------
    basis
        Of the source's points, normalised.
    coordinates
        The spline to begin with; its matrix is what the affine part is held to.
    target
        Normalised points, shape (m, d).
    cooling
        The temperatures.
    """
    rows, columns = spread_order(basis.points), spread_order(target)
    all_at_once = len(rows) <= COARSE[0] and len(columns) <= COARSE[1]
    spread = 0.0 if all_at_once else FINE * _spacing(target, columns)
    hold, balance = coordinates[basis.bent + 1 :], np.ones(len(target))
    temperature = cooling.start
    while temperature > cooling.end:
        finer = max(spread**2 / temperature, 1.0) ** (target.shape[1] / 2)
        here, there = rows[: int(COARSE[0] * finer)], columns[: int(COARSE[1] * finer)]
        some = basis if len(here) == len(rows) else basis.at(here)
        coordinates, balance[there] = _settle(
            some, coordinates, target[there], temperature, balance[there], hold, cooling.rounds
        )
        temperature *= cooling.factor
    return coordinates


def _spacing(target: NDArray[np.float64], order: NDArray[np.int64]) -> float:
    """Median distance between neighbours in the coarsest sample of the target, which may be all of it."""
    few = target[order[: COARSE[1]]]
    return float(np.median(np.sort(cdist(few, few))[:, 1]))


def _settle(
    basis: SplineBasis,
    coordinates: NDArray[np.float64],
    target: NDArray[np.float64],
    temperature: float,
    balance: NDArray[np.float64],
    hold: NDArray[np.float64],
    rounds: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Pairs and spline in turn at one temperature."""
    transformed = basis.design @ coordinates
    for _ in range(rounds):
        paired, drawn, balance = soft_pairs(transformed, target, temperature, balance)
        coordinates = _follow(basis, paired, drawn, temperature, hold)
        before, transformed = transformed, basis.design @ coordinates
        if np.max((transformed - before) ** 2) < SETTLED**2 * temperature:
            break
    return coordinates, balance


def soft_pairs(
    transformed: NDArray[np.float64], target: NDArray[np.float64], temperature: float, balance: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """What soft pairs of the moved source, shape (n, d), and the target, shape (m, d), say.

    Parameters
    ----------
    transformed, target
        The points.
    temperature
        T, positive.
    balance
        Factors of the target's points to begin with, shape (m,): those of a temperature little different save most of
        the work.

    Returns
    -------
    paired
        Sum of each source point's weights, in [0, 1], shape (n,).
    drawn
        Sum of the targets that they weigh, shape (n, d).
    balance
        Factors of the target's points, shape (m,).
    """
    order = np.argsort(target[:, 0], kind="stable")
    single, stray = outlier_weights(transformed), outlier_weights(target)
    paired, drawn, sorted_balance = _balanced(
        transformed, target[order], temperature, balance[order], single, stray[order], BALANCINGS, BALANCED, CUT_OFF
    )
    balance = np.empty_like(balance)
    balance[order] = sorted_balance
    return paired, drawn, balance


@fused
def _balanced(
    transformed: NDArray[np.float64],
    target: NDArray[np.float64],
    temperature: float,
    balance: NDArray[np.float64],
    single: NDArray[np.float64],
    stray: NDArray[np.float64],
    most: int,
    enough: float,
    extent: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """The parts of `soft_pairs`; the target ascends along the first axis, so that near points lie in one run."""
    n, dimension = transformed.shape
    first_axis = np.ascontiguousarray(target[:, 0])
    farthest = np.sqrt(extent * temperature)
    start = np.zeros(n + 1, dtype=np.int64)
    column = np.empty(4 * (n + len(target)), dtype=np.int64)
    near = np.empty(len(column))
    pairs = 0
    for i in range(n):
        first = np.searchsorted(first_axis, transformed[i, 0] - farthest)
        last = np.searchsorted(first_axis, transformed[i, 0] + farthest)
        for j in range(first, last):
            away = 0.0
            for axis in range(dimension):
                away += (transformed[i, axis] - target[j, axis]) ** 2
            if away < extent * temperature:
                if pairs == len(column):
                    column = np.append(column, np.empty(pairs, dtype=np.int64))
                    near = np.append(near, np.empty(pairs))
                column[pairs], near[pairs] = j, np.exp(-away / (2 * temperature)) / temperature
                pairs += 1
        start[i + 1] = pairs
    rows = np.empty(n)
    for _ in range(most):
        columns = stray.copy()
        for i in range(n):
            total = single[i]
            for pair in range(start[i], start[i + 1]):
                total += near[pair] * balance[column[pair]]
            rows[i] = 1 / total
            for pair in range(start[i], start[i + 1]):
                columns[column[pair]] += rows[i] * near[pair]
        change = 0.0
        for j in range(len(target)):
            change = max(change, abs(1 / (columns[j] * balance[j]) - 1))
            balance[j] = 1 / columns[j]
        if change < enough:
            break
    paired, drawn = np.zeros(n), np.zeros((n, dimension))
    for i in range(n):
        for pair in range(start[i], start[i + 1]):
            weight = rows[i] * near[pair] * balance[column[pair]]
            paired[i] += weight
            for axis in range(dimension):
                drawn[i, axis] += weight * target[column[pair], axis]
    return paired, drawn, balance


def reference_soft_pairs(
    transformed: NDArray[np.float64], target: NDArray[np.float64], temperature: float, *, balancings: int = 2000
) -> NDArray[np.float64]:
    """The weights that `soft_pairs` sums, shape (n, m), from the whole matrix with the outliers' row and column."""
    weights = np.zeros((len(transformed) + 1, len(target) + 1))
    weights[:-1, :-1] = np.exp(-cdist(transformed, target, "sqeuclidean") / (2 * temperature)) / temperature
    weights[:-1, -1], weights[-1, :-1] = outlier_weights(transformed), outlier_weights(target)
    for _ in range(balancings):
        weights[:-1] /= weights[:-1].sum(axis=1, keepdims=True)
        weights[:, :-1] /= weights[:, :-1].sum(axis=0, keepdims=True)
    return weights[:-1, :-1]


def outlier_weights(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weight of having no partner, shape (n,): a Gaussian about the mass centre at the starting temperature."""
    away = np.sum((points - points.mean(axis=0)) ** 2, axis=1)
    return np.asarray(np.exp(-away / (2 * START)) / START)


def _follow(
    basis: SplineBasis,
    paired: NDArray[np.float64],
    drawn: NDArray[np.float64],
    temperature: float,
    hold: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Coordinates of the spline that follows the weighed targets, as far as the temperature lets it."""
    normal = basis.design.T @ (paired[:, None] * basis.design)
    right = basis.design.T @ drawn
    resting = temperature * len(paired)
    ridge = np.full(len(normal), BENDING * resting)
    ridge[basis.bent] = 1e-12 * resting  # the translation is free, but for no weight at all
    ridge[basis.bent + 1 :] = TURNING * resting
    right[basis.bent + 1 :] += ridge[basis.bent + 1 :, None] * hold
    return ridge_solution(normal, right, ridge)
