"""Robust matching that preserves neighbourhoods (Zheng and Doermann 2006).

A pair (i, j) is supported by the pairs (a, b) of i's neighbours a with j's neighbours b, with equal weights.
Probabilities start from shape contexts; each update multiplies them by their support and normalises rows and columns
with a probability of no partner. A thin-plate spline is fitted to the pairs, and the next round starts from the
transformed points.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.compiled import compiled
from tsis.matching.methods import UNMATCHED, Floats, Integers, MatchFit, assign
from tsis.matching.shape_context import chi_squared, histograms
from tsis.matching.spline import spline_basis

if TYPE_CHECKING:
    from numpy.typing import NDArray


ROUNDS = 10
UPDATES = 10  # published as 300: more are slower and match no more, since wrong pairs converge too
NEIGHBOURS = 5
CANDIDATES = 25  # of each point, by shape context
SHARPNESS = 0.03  # chi-squared distance that reduces the probability of a pair by 1/e
FIRST_NO_PARTNER = 0.2  # initial probability of no partner
LEAST_AGREEMENT = 0.35  # fraction of agreeing neighbours at which a pair is as likely as no partner
BALANCINGS = 2  # of rows and columns after each update
SETTLED = 1e-3  # largest change of a probability that ends the updates
BENDING, SOFTENING = 30.0, 0.5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pairs:
    """Candidate pairs, as the entries of a sparse matrix in row order."""

    row: Integers  # source point of each pair, shape (p,)
    column: Integers  # target point of each pair, shape (p,)
    shape: tuple[int, int]  # numbers of source and target points


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Chances:
    """Probabilities of the pairs, and of points without partner."""

    pair: Floats  # in the order of `Pairs`, shape (p,)
    source: Floats  # of no partner, shape (n,)
    target: Floats  # of no partner, shape (m,)


def fit(source: Floats, target: Floats, /, *, rng: np.random.Generator) -> MatchFit:
    """Match normalised points, shapes (n, d) and (m, d), by their neighbourhoods; the method is deterministic."""
    del rng
    basis, target_contexts = spline_basis(source), histograms(target)
    graphs = neighbours(source), neighbours(target)
    transformed, last = source, np.full(len(source), UNMATCHED)
    for number in range(ROUNDS):
        cost = chi_squared(histograms(transformed), target_contexts)
        pairs = candidates(cost)
        likely = np.exp(-cost[pairs.row, pairs.column] / SHARPNESS)
        matches, trust = _best(relax(likely, support(pairs, *graphs), pairs), pairs)
        coordinates = basis.coordinates(
            np.where(matches[:, None] != UNMATCHED, target[matches], 0.0),
            bending=BENDING * SOFTENING**number,
            weights=trust,
        )
        transformed = basis.design @ coordinates
        if number >= ROUNDS // 2 and np.array_equal(matches, last):  # earlier, the spline still softens
            break
        last = matches
    return MatchFit(move=basis.spline(coordinates), matches=matches, trust=trust)


def neighbours(points: Floats) -> scipy.sparse.csr_array:
    """Symmetric graph of the `NEIGHBOURS` nearest neighbours: 1 where points are neighbours, shape (n, n)."""
    number = len(points)
    count = min(NEIGHBOURS, number - 1)
    _, index = scipy.spatial.KDTree(points).query(points, k=range(1, count + 2))
    row = np.repeat(np.arange(number), count + 1)
    graph = scipy.sparse.csr_array((np.ones(row.size), (row, index.ravel())), shape=(number, number))
    graph = graph + graph.T
    graph.setdiag(0)  # of coincident points, any may be the first
    graph.eliminate_zeros()
    graph.data[:] = 1
    return graph


def candidates(cost: Floats) -> Pairs:
    """The `CANDIDATES` cheapest pairs of each row."""
    n, m = cost.shape
    count = min(CANDIDATES, m)
    column = np.sort(np.argpartition(cost, count - 1, axis=1)[:, :count], axis=1)
    return Pairs(row=np.repeat(np.arange(n), count), column=column.ravel().astype(np.int64), shape=(n, m))


def support(pairs: Pairs, source: scipy.sparse.csr_array, target: scipy.sparse.csr_array) -> scipy.sparse.csr_array:
    """Matrix of the support between pairs, shape (p, p).

    It is one over the larger number of neighbours where the points of two pairs are neighbours, else 0: the product
    with the probabilities is the fraction of neighbours that agree.
    """
    position = np.full(pairs.shape, -1, dtype=np.int64)
    position[pairs.row, pairs.column] = np.arange(len(pairs.row))
    start, end, weight = _supporters(
        pairs.row, pairs.column, position, source.indptr, source.indices, target.indptr, target.indices
    )
    return scipy.sparse.csr_array((weight, end, start), shape=(len(pairs.row), len(pairs.row)))


def relax(likely: Floats, supported: scipy.sparse.csr_array, pairs: Pairs) -> Chances:
    """Relaxed probabilities, from the initial likelihood of each pair, shape (p,)."""
    n, m = pairs.shape
    chances = Chances(
        pair=likely * n / likely.sum(), source=np.full(n, FIRST_NO_PARTNER), target=np.full(m, FIRST_NO_PARTNER)
    )
    for _ in range(UPDATES):
        before = chances.pair
        chances = _balanced(
            Chances(
                pair=before * (supported @ before),
                source=chances.source * LEAST_AGREEMENT,
                target=chances.target * LEAST_AGREEMENT,
            ),
            pairs,
        )
        if np.max(np.abs(chances.pair - before)) < SETTLED:
            break
    return chances


def _balanced(chances: Chances, pairs: Pairs) -> Chances:
    """Normalise rows, then columns, to one together with the probability of no partner."""
    pair, source, target = chances.pair, chances.source, chances.target
    for _ in range(BALANCINGS):
        row = 1 / (np.bincount(pairs.row, pair, pairs.shape[0]) + source)
        pair, source = pair * row[pairs.row], source * row
        column = 1 / (np.bincount(pairs.column, pair, pairs.shape[1]) + target)
        pair, target = pair * column[pairs.column], target * column
    return Chances(pair=pair, source=source, target=target)


def _best(chances: Chances, pairs: Pairs) -> tuple[Integers, Floats]:
    """Matches of the largest total probability, and their probabilities."""
    chance = np.zeros(pairs.shape)
    chance[pairs.row, pairs.column] = np.minimum(chances.pair, 1.0)
    matches = assign(-chance, dummy=-SETTLED)
    return matches, np.where(matches == UNMATCHED, 0.0, chance[np.arange(len(matches)), matches])


@compiled
def _supporters(
    row: Integers,
    column: Integers,
    position: Integers,
    source_start: NDArray[np.int32],
    source_end: NDArray[np.int32],
    target_start: NDArray[np.int32],
    target_end: NDArray[np.int32],
) -> tuple[Integers, Integers, Floats]:
    """Rows of the support matrix; ``position`` is a pair's index among the candidates, else -1."""
    start = np.zeros(len(row) + 1, np.int64)
    most = 0
    for e in range(len(row)):
        i, j = row[e], column[e]
        most += (source_start[i + 1] - source_start[i]) * (target_start[j + 1] - target_start[j])
    end, weight = np.empty(most, np.int64), np.empty(most)
    filled = 0
    for e in range(len(row)):
        i, j = row[e], column[e]
        larger = max(source_start[i + 1] - source_start[i], target_start[j + 1] - target_start[j])
        for a in source_end[source_start[i] : source_start[i + 1]]:
            for b in target_end[target_start[j] : target_start[j + 1]]:
                if position[a, b] >= 0:
                    end[filled], weight[filled] = position[a, b], 1 / larger
                    filled += 1
        start[e + 1] = filled
    return start, end[:filled], weight[:filled]
