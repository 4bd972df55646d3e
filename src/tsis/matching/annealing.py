"""Deterministic annealing of soft correspondences and a spline (Chui and Rangarajan 2003).

At a temperature T (a squared length) pairs have the weight ``exp(-|y - f(x)|**2 / 2T) / T``; each set has an outlier
as wide as the points at the start. Alternating normalisation (Sinkhorn) makes the weights of each point, including its
outlier, sum to one. The spline is fitted to the weighted targets with the ridges ``BENDING T`` on its bending and
``ROTATION T`` on the change of its affine part, both times the number of points. Then T falls.

`annealed_map` pairs points in the same way with an affine map and a smooth displacement field of given prior variances,
which small samples and many starts need.

Only the sum of each source point's weights and its weighted sum of targets are computed. Pairs farther than `CUT_OFF`
are omitted. Large sets are sampled at high temperatures, with more points as T falls, so that each point has a few
pairs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.compiled import fused
from tsis.matching.methods import Floats, Integers, MatchFit, nearest_pairs, ridge_map, spacing
from tsis.matching.spline import spline_basis, spread_order, spread_out

if TYPE_CHECKING:
    from tsis.matching.spline import SplineBasis


START = 3.0  # temperature, in squared root-mean-square radii: half a unit box's, whose side is 2.45 of them
BENDING = 1.0
ROTATION = 0.3  # published as 0.01; 0.3 matches more of the deformed, cluttered and occluded shapes
SETTLED = 0.03  # of a standard deviation: a round ends when no point moves farther
BALANCED = 1e-2  # tolerance of a point's sum of weights; the next round continues from there
BALANCINGS = 10
CUT_OFF = 24.0  # of T: squared distance beyond which the weight exp(-12) is neglected
COARSE = (120, 350)  # points of source and target sampled at the first temperature
FINE = 0.5  # least standard deviation, of the spacing of the sampled target


@dataclass(frozen=True, slots=True, kw_only=True)
class Cooling:
    """Geometric cooling from ``start`` to ``end``, with at most ``rounds`` rounds at a temperature."""

    factor: float
    start: float
    end: float
    rounds: int


def anneal(basis: SplineBasis, coordinates: Floats, target: Floats, cooling: Cooling) -> Floats:
    """Coordinates, shape (k, d), of the spline at the source's points after cooling towards ``target``, shape (m, d).

    Points are normalised. ``coordinates`` is the initial spline; the ridge draws the affine part to its matrix.
    """
    rows, columns = spread_order(basis.points), spread_order(target)
    small = len(rows) <= COARSE[0] and len(columns) <= COARSE[1]
    spread = 0.0 if small else FINE * _spacing(target, columns)
    initial, balance = coordinates[basis.bent + 1 :], np.ones(len(target))
    temperature = cooling.start
    while temperature > cooling.end:
        finer = max(spread**2 / temperature, 1.0) ** (target.shape[1] / 2)
        here, there = rows[: int(COARSE[0] * finer)], columns[: int(COARSE[1] * finer)]
        sample = basis if len(here) == len(rows) else basis.at(here)
        coordinates, balance[there] = _settle(
            sample, coordinates, target[there], temperature, balance[there], initial, cooling.rounds
        )
        temperature *= cooling.factor
    return coordinates


def _spacing(target: Floats, order: Integers) -> float:
    """Median distance between neighbours in the coarsest sample of the target."""
    sample = target[order[: COARSE[1]]]
    return float(np.median(np.sort(scipy.spatial.distance.cdist(sample, sample))[:, 1]))


def _settle(
    basis: SplineBasis,
    coordinates: Floats,
    target: Floats,
    temperature: float,
    balance: Floats,
    initial: Floats,
    rounds: int,
) -> tuple[Floats, Floats]:
    """Alternate pairs and spline at one temperature."""
    transformed = basis.design @ coordinates
    for _ in range(rounds):
        paired, drawn, balance = soft_pairs(transformed, target, temperature, balance)
        coordinates = _fitted_spline(basis.design, basis.bent, paired, drawn, temperature, initial)
        before, transformed = transformed, basis.design @ coordinates
        if np.max((transformed - before) ** 2) < SETTLED**2 * temperature:
            break
    return coordinates, balance


def soft_pairs(
    transformed: Floats, target: Floats, temperature: float, balance: Floats
) -> tuple[Floats, Floats, Floats]:
    """Sums over the soft pairs of the transformed source (n, d) and the target (m, d) at a temperature.

    Returns the sum of each source point's weights, in [0, 1], shape (n,), its weighted sum of the targets, shape (n,
    d), and the factors of the target's points, shape (m,). The initial factors ``balance`` of a similar temperature
    save most of the work.
    """
    order = np.argsort(target[:, 0], kind="stable")
    source_outliers, target_outliers = outlier_weights(transformed), outlier_weights(target)[order]
    paired, drawn, sorted_balance = _balanced(
        transformed,
        target[order],
        temperature,
        balance[order],
        source_outliers,
        target_outliers,
        BALANCINGS,
        BALANCED,
        CUT_OFF,
    )
    balance = np.empty_like(balance)
    balance[order] = sorted_balance
    return paired, drawn, balance


@fused
def _balanced(
    transformed: Floats,
    target: Floats,
    temperature: float,
    balance: Floats,
    source_outliers: Floats,
    target_outliers: Floats,
    rounds: int,
    tolerance: float,
    cut_off: float,
) -> tuple[Floats, Floats, Floats]:
    """Kernel of `soft_pairs`; the target ascends along the first axis, so that near points are contiguous."""
    n, dimension = transformed.shape
    first_axis = np.ascontiguousarray(target[:, 0])
    farthest = np.sqrt(cut_off * temperature)
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
            if away < cut_off * temperature:
                if pairs == len(column):
                    column = np.append(column, np.empty(pairs, dtype=np.int64))
                    near = np.append(near, np.empty(pairs))
                column[pairs], near[pairs] = j, np.exp(-away / (2 * temperature)) / temperature
                pairs += 1
        start[i + 1] = pairs
    rows = np.empty(n)
    for _ in range(rounds):
        columns = target_outliers.copy()
        for i in range(n):
            total = source_outliers[i]
            for pair in range(start[i], start[i + 1]):
                total += near[pair] * balance[column[pair]]
            rows[i] = 1 / total
            for pair in range(start[i], start[i + 1]):
                columns[column[pair]] += rows[i] * near[pair]
        change = 0.0
        for j in range(len(target)):
            change = max(change, abs(1 / (columns[j] * balance[j]) - 1))
            balance[j] = 1 / columns[j]
        if change < tolerance:
            break
    paired, drawn = np.zeros(n), np.zeros((n, dimension))
    for i in range(n):
        for pair in range(start[i], start[i + 1]):
            weight = rows[i] * near[pair] * balance[column[pair]]
            paired[i] += weight
            for axis in range(dimension):
                drawn[i, axis] += weight * target[column[pair], axis]
    return paired, drawn, balance


@fused
def outlier_weights(points: Floats) -> Floats:
    """Weight of being unmatched, shape (n,): a Gaussian about the mass centre at the starting temperature."""
    away = np.zeros(len(points))
    for axis in range(points.shape[1]):
        away += (points[:, axis] - points[:, axis].mean()) ** 2
    return np.exp(-away / (2 * START)) / START


@fused
def _fitted_spline(
    design: Floats, bent: int, paired: Floats, drawn: Floats, temperature: float, initial: Floats
) -> Floats:
    """Coordinates of the spline fitted to the weighted targets with the ridges of the temperature."""
    across = np.ascontiguousarray(design.T)
    normal, right = (across * paired) @ design, across @ drawn
    scale = temperature * len(paired)
    for k in range(bent):
        normal[k, k] += BENDING * scale
    normal[bent, bent] += 1e-12 * scale  # the translation is free; this only regularises zero weight
    for k in range(bent + 1, len(normal)):
        normal[k, k] += ROTATION * scale
        right[k] += ROTATION * scale * initial[k - bent - 1]
    return ridge_map(normal, right, 0.0)


FACTOR, ROUNDS = 0.9, 4  # of the published cooling
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


LEAST_LOG = -12.0  # of a likelihood that is not neglected
NO_PARTNER = 3.0  # standard deviations: an unmatched point is as likely as a partner at that distance
FIELD_BALANCINGS = 3
FIELD_WIDTHS, FIELD_AMPLITUDES = (0.5, 0.9), (0.05, 0.2)
AFFINE_SD = 0.3


@fused
def annealed_map(
    design: Floats, ridge: Floats, target: Floats, start: Floats, sigmas: Floats, rounds: int
) -> tuple[Floats, float]:
    """Alternate soft pairs at falling ``sigmas`` and ridge regression on ``design``, shape (n, k), from ``start``.

    The ridge, shape (k,), is the inverse prior variance of each coordinate about its start, shape (k, d). Returns the
    coordinates of the map and its penalised log likelihood at the last standard deviation.
    """
    n, k = design.shape
    dimension = target.shape[1]
    coordinates = start.copy()
    weighted = np.empty((k, n))
    across = np.ascontiguousarray(design.T)
    beside = np.ones((len(target), dimension + 1))
    beside[:, :dimension] = target
    for sigma in sigmas:
        for _ in range(rounds):
            pairs = balanced_pairs(design @ coordinates, target, sigma, FIELD_BALANCINGS)
            drawn = pairs @ beside
            for c in range(k):
                for i in range(n):
                    weighted[c, i] = across[c, i] * drawn[i, dimension]
            normal = weighted @ design
            right = across @ np.ascontiguousarray(drawn[:, :dimension])
            for c in range(k):
                normal[c, c] += ridge[c] * sigma**2
                for axis in range(dimension):
                    right[c, axis] += ridge[c] * sigma**2 * start[c, axis]
            coordinates = np.ascontiguousarray(np.linalg.solve(normal, right))
    moved = design @ coordinates
    return coordinates, _score(moved, target, sigmas[-1], ridge, coordinates, start)


@fused
def balanced_pairs(moved: Floats, target: Floats, sigma: float, rounds: int) -> Floats:
    """Soft pairs, shape (n, m), whose rows and columns sum to at most about one."""
    near = _likelihoods(moved, target, sigma, LEAST_LOG)
    unpaired = np.exp(-0.5 * NO_PARTNER**2)
    rows, columns = np.ones(len(moved)), np.ones(len(target))
    for _ in range(rounds):
        rows = 1 / (unpaired + near @ columns)
        columns = 1 / (unpaired + rows @ near)
    for i in range(len(moved)):
        for j in range(len(target)):
            near[i, j] *= rows[i] * columns[j]
    return near


@fused
def _likelihoods(moved: Floats, target: Floats, sigma: float, least: float) -> Floats:
    """``exp(-|x - y|**2 / (2 sigma**2))`` of each pair, shape (n, m); 0 below ``exp(least)``, where least >= -36."""
    axes = np.ascontiguousarray(target.T)
    near = np.zeros((len(moved), len(target)))
    scale = -0.5 / sigma**2
    for i in range(len(moved)):
        for axis in range(len(axes)):
            for j in range(len(target)):
                near[i, j] += scale * (moved[i, axis] - axes[axis, j]) ** 2
        for j in range(len(target)):
            # the power 1024 of the series of exp(x / 1024), which the compiler turns into vector operations
            x = max(near[i, j], least) / 1024
            power = 1 + x * (1 + x / 2 * (1 + x / 3 * (1 + x / 4 * (1 + x / 5))))
            power *= power
            power *= power
            power *= power
            power *= power
            power *= power
            power *= power
            power *= power
            power *= power
            power *= power
            power *= power
            near[i, j] = power if near[i, j] > least else 0.0
    return near


def field_design(source: Floats, rows: Integers) -> tuple[Floats, Floats]:
    """Affine columns and field columns at the source's points, shape (n, k), and the inverse variances, shape (k,)."""
    control = source[rows]
    among, across = (
        sum(
            amplitude**2 * np.exp(-0.5 * scipy.spatial.distance.cdist(points, control, "sqeuclidean") / width**2)
            for width, amplitude in zip(FIELD_WIDTHS, FIELD_AMPLITUDES, strict=True)
        )
        for points in (control, source)
    )
    value, vector = np.linalg.eigh(among)
    large = value > 1e-5 * value[-1]
    bends = across @ (vector[:, large] / np.sqrt(value[large]))
    dimension = source.shape[1]
    ridge = np.concatenate([[1e-6], np.full(dimension, AFFINE_SD**-2), np.ones(bends.shape[1])])
    return np.column_stack([np.ones(len(source)), source, bends]), ridge


@fused
def _score(moved: Floats, target: Floats, sigma: float, ridge: Floats, coordinates: Floats, start: Floats) -> float:
    totals = np.exp(-0.5 * NO_PARTNER**2) + np.ones(len(moved)) @ _likelihoods(moved, target, sigma, -36.0)
    score = float(np.log(totals).sum())
    for c in range(len(ridge)):
        for axis in range(target.shape[1]):
            score -= 0.5 * ridge[c] * (coordinates[c, axis] - start[c, axis]) ** 2
    return score
