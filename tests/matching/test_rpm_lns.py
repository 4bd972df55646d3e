"""Neighbourhoods preserved: sparse relaxation against whole matrices, known deformations, what holds of any method."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from tsis.matching import neighbourhoods as rpm_lns
from tsis.matching.shape_context import chi_squared, histograms

if TYPE_CHECKING:
    from tests.matching.conftest import Warped

RNG = np.random.default_rng(0)


@pytest.mark.parametrize("missing", [0, 10])
def test_sparse_relaxation_equals_whole_matrices(warped: Warped, missing: int, monkeypatch: pytest.MonkeyPatch) -> None:
    target = warped.target[missing:]
    monkeypatch.setattr(rpm_lns, "CANDIDATES", len(target))
    cost = chi_squared(histograms(warped.source), histograms(target))
    likely = np.exp(-cost / rpm_lns.SHARPNESS)
    pairs = rpm_lns.candidates(cost)
    graphs = rpm_lns.neighbours(warped.source), rpm_lns.neighbours(target)
    chances = rpm_lns.relax(likely[pairs.row, pairs.column], rpm_lns.support(pairs, *graphs), pairs)
    whole = rpm_lns.reference_relax(likely, *(graph.toarray() for graph in graphs))
    np.testing.assert_allclose(chances.pair.reshape(cost.shape), whole, atol=1e-9)


def test_neighbours_are_the_nearest_of_either() -> None:
    points = np.random.default_rng(1).normal(size=(30, 2))
    distance = cdist(points, points)
    nearest = distance <= np.sort(distance, axis=1)[:, [rpm_lns.NEIGHBOURS]]
    expected = (nearest | nearest.T) & ~np.eye(30, dtype=bool)
    np.testing.assert_array_equal(rpm_lns.neighbours(points).toarray(), expected)


def test_points_in_one_place_are_neighbours_but_not_their_own() -> None:
    graph = rpm_lns.neighbours(np.zeros((8, 2))).toarray()
    assert np.all(np.diag(graph) == 0)
    np.testing.assert_array_equal(graph, graph.T)


def test_finds_a_smooth_deformation(warped: Warped) -> None:
    found = rpm_lns.fit(warped.source, warped.target, rng=RNG)
    assert warped.right(found.matches) > 0.95
    assert warped.rms(found.move(warped.source)) < 0.05
    assert 0.9 < np.median(found.trust) <= found.trust.max() <= 1


def test_new_points_go_where_their_neighbours_go(warped: Warped) -> None:
    found = rpm_lns.fit(warped.source, warped.target, rng=RNG)
    between = (warped.source[:-1] + warped.source[1:]) / 2
    between = between[np.linalg.norm(between, axis=1) < 0.8]
    np.testing.assert_allclose(found.move(between), warped.goes(between), atol=0.1)


def test_permuting_the_target_permutes_the_matches(warped: Warped) -> None:
    order = np.random.default_rng(1).permutation(len(warped.target))
    one = rpm_lns.fit(warped.source, warped.target, rng=RNG)
    other = rpm_lns.fit(warped.source, warped.target[order], rng=RNG)
    np.testing.assert_array_equal(np.where(other.matches < 0, -1, order[other.matches]), one.matches)
    np.testing.assert_allclose(other.move(warped.source), one.move(warped.source), atol=1e-6)


def test_no_target_is_taken_twice(warped: Warped) -> None:
    found = rpm_lns.fit(warped.source, warped.target[: len(warped.target) // 2], rng=RNG)
    matched = found.matches[found.matches >= 0]
    assert len(set(matched)) == len(matched) <= len(warped.target) // 2
    assert np.all(found.trust[found.matches < 0] == 0)
