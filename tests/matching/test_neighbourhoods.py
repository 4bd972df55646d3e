"""Neighbourhoods preserved: sparse relaxation against whole matrices, known deformations, what holds of any method."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from tsis.matching import neighbourhoods
from tsis.matching.shape_context import chi_squared, histograms

if TYPE_CHECKING:
    from tests.matching.conftest import Warped

RNG = np.random.default_rng(0)


def _whole_relaxation(likely: np.ndarray, source: np.ndarray, target: np.ndarray) -> np.ndarray:
    """`neighbourhoods.relax` with all pairs as candidates, by full matrices of shapes (n, m), (n, n) and (m, m)."""
    chance = np.zeros((len(source) + 1, len(target) + 1))
    chance[:-1, :-1] = likely * len(source) / likely.sum()
    chance[:-1, -1] = chance[-1, :-1] = neighbourhoods.FIRST_NO_PARTNER
    agreeing = np.maximum(source.sum(axis=1)[:, None], target.sum(axis=1))
    for _ in range(neighbourhoods.UPDATES):
        before = chance[:-1, :-1].copy()
        chance[:-1, :-1] *= source @ before @ target / agreeing
        chance[:-1, -1] *= neighbourhoods.LEAST_AGREEMENT
        chance[-1, :-1] *= neighbourhoods.LEAST_AGREEMENT
        for _ in range(neighbourhoods.BALANCINGS):
            chance[:-1] /= chance[:-1].sum(axis=1, keepdims=True)
            chance[:, :-1] /= chance[:, :-1].sum(axis=0, keepdims=True)
        if np.max(np.abs(chance[:-1, :-1] - before)) < neighbourhoods.SETTLED:
            break
    return np.asarray(chance[:-1, :-1])


@pytest.mark.parametrize("missing", [0, 10])
def test_sparse_relaxation_equals_whole_matrices(warped: Warped, missing: int, monkeypatch: pytest.MonkeyPatch) -> None:
    target = warped.target[missing:]
    monkeypatch.setattr(neighbourhoods, "CANDIDATES", len(target))
    cost = chi_squared(histograms(warped.source), histograms(target))
    likely = np.exp(-cost / neighbourhoods.SHARPNESS)
    pairs = neighbourhoods.candidates(cost)
    graphs = neighbourhoods.neighbours(warped.source), neighbourhoods.neighbours(target)
    chances = neighbourhoods.relax(likely[pairs.row, pairs.column], neighbourhoods.support(pairs, *graphs), pairs)
    whole = _whole_relaxation(likely, *(graph.toarray() for graph in graphs))
    np.testing.assert_allclose(chances.pair.reshape(cost.shape), whole, atol=1e-9)


def test_neighbours_are_the_nearest_of_either() -> None:
    points = np.random.default_rng(1).normal(size=(30, 2))
    distance = cdist(points, points)
    nearest = distance <= np.sort(distance, axis=1)[:, [neighbourhoods.NEIGHBOURS]]
    expected = (nearest | nearest.T) & ~np.eye(30, dtype=bool)
    np.testing.assert_array_equal(neighbourhoods.neighbours(points).toarray(), expected)


def test_points_in_one_place_are_neighbours_but_not_their_own() -> None:
    graph = neighbourhoods.neighbours(np.zeros((8, 2))).toarray()
    assert np.all(np.diag(graph) == 0)
    np.testing.assert_array_equal(graph, graph.T)


def test_no_target_is_taken_twice(warped: Warped) -> None:
    found = neighbourhoods.fit(warped.source, warped.target[: len(warped.target) // 2], rng=RNG)
    matched = found.matches[found.matches >= 0]
    assert len(set(matched)) == len(matched) <= len(warped.target) // 2
    assert np.all(found.trust[found.matches < 0] == 0)
