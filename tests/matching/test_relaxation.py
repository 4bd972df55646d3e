"""Relaxation labelling: against products of whole matrices, and on points whose partners are known."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from tsis.matching import relaxation
from tsis.matching.relaxation import (
    CANDIDATES,
    NEIGHBOURS,
    TARGET_NEIGHBOURS,
    UPDATES,
    Labels,
    Neighbourhood,
    cheapest,
    label,
)
from tsis.matching.shape_context import chi_squared, histograms

if TYPE_CHECKING:
    from tests.matching.conftest import Warped

ALONE = 0.07


def _whole_supports(source: Neighbourhood, target: Neighbourhood) -> np.ndarray:
    """Support ``[i, j, a, b]`` of pair (i, j) by pair (a, b), shape (n, m, n, m): the terms of (5.12) in full."""
    difference = np.abs(source.log_distance[:, None, :, None] - target.log_distance[None, :, None, :])
    alpha = np.maximum(1 - difference / relaxation.SAME_DISTANCE, 0)
    beta = np.maximum(np.einsum("iad,jbd->ijab", source.direction, target.direction), 0)
    n, m = len(source.index), len(target.index)
    i, j = np.arange(n)[:, None, None, None], np.arange(m)[None, :, None, None]
    supports = np.zeros((n, m, n, m))
    supports[i, j, source.index[:, None, :, None], target.index[None, :, None, :]] = (
        alpha * beta * source.nearness[:, None, :, None]
    )
    return supports


def _whole_label(
    source: Neighbourhood, target: Neighbourhood, cost: np.ndarray, *, single: float, updates: int = UPDATES
) -> np.ndarray:
    """The probabilities of `label` as a full matrix, shape (n, m), from products of full matrices."""
    supports, candidates = _whole_supports(source, target), cheapest(cost, CANDIDATES)
    allowed = np.zeros(cost.shape)
    none = np.full((len(cost), 1), 1 / (candidates.shape[1] + 1))
    np.put_along_axis(allowed, candidates, 1.0, axis=1)
    probability = allowed * np.exp((cost.min(axis=1, keepdims=True) - cost) / relaxation.SHARPNESS)
    probability *= (1 - none) / probability.sum(axis=1, keepdims=True)
    for _ in range(updates):
        before = probability
        probability, none = probability * np.tensordot(supports, probability, axes=2), none * single
        for _ in range(relaxation.NORMALISATIONS):
            total = none + probability.sum(axis=1, keepdims=True)
            probability, none = probability / total, none / total
            probability = probability / np.maximum(probability.sum(axis=0), 1)
        none = np.maximum(1 - probability.sum(axis=1, keepdims=True), 0)
        probability[probability < relaxation.NOTHING] = 0
        if np.max(np.abs(probability - before)) < relaxation.SETTLED:
            break
    return np.asarray(probability)


def _cluttered(dimension: int, seed: int, count: int = 34) -> tuple[np.ndarray, np.ndarray]:
    """Points, and a target that lacks the first six of them and has eight others."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(count, dimension))
    warped = points + 0.08 * np.sin(2 * points[:, ::-1])
    return points, np.vstack([warped[6:], rng.normal(size=(8, dimension))])


def _labels(source: np.ndarray, target: np.ndarray, updates: int = UPDATES) -> Labels:
    here, there = Neighbourhood.of(source, NEIGHBOURS), Neighbourhood.of(target, TARGET_NEIGHBOURS)
    return label(here, there, chi_squared(histograms(source), histograms(target)), single=ALONE, updates=updates)


def _whole(labels: Labels, columns: int) -> np.ndarray:
    whole = np.zeros((len(labels.candidates), columns))
    np.put_along_axis(whole, labels.candidates, labels.probability, axis=1)
    return whole


@pytest.mark.parametrize("dimension", [2, 3], ids=["plane", "space"])
@pytest.mark.parametrize("updates", [1, 4, 30])
@pytest.mark.parametrize("seed", [0, 1])
def test_labels_equal_those_of_whole_matrices(dimension: int, updates: int, seed: int) -> None:
    source, target = _cluttered(dimension, seed)
    cost = chi_squared(histograms(source), histograms(target))
    here, there = Neighbourhood.of(source, NEIGHBOURS), Neighbourhood.of(target, TARGET_NEIGHBOURS)
    found = label(here, there, cost, single=ALONE, updates=updates)
    plain = _whole_label(here, there, cost, single=ALONE, updates=updates)
    np.testing.assert_allclose(_whole(found, len(target)), plain, atol=1e-6)
    assert np.sum(found.probability > 0) > len(source)  # beyond one a row: else little would be compared


@pytest.mark.parametrize("dimension", [2, 3], ids=["plane", "space"])
def test_supports_equal_the_formula_pair_by_pair(dimension: int) -> None:
    rng = np.random.default_rng(4)
    source, target = rng.normal(size=(7, dimension)), rng.normal(size=(8, dimension))
    supports = _whole_supports(Neighbourhood.of(source, 3), Neighbourhood.of(target, 4))
    here, there = cdist(source, source), cdist(target, target)
    for i, j, a, b in product(range(7), range(8), repeat=2):
        near, close = np.sort(here[i])[1:4], np.sort(there[j])[1:5]
        if i == a or j == b or here[i, a] > near[-1] or there[j, b] > close[-1]:
            assert supports[i, j, a, b] == 0
            continue
        alpha = max(1 - abs(np.log(here[i, a] / there[j, b])), 0)
        beta = max((source[a] - source[i]) @ (target[b] - target[j]) / here[i, a] / there[j, b], 0)
        gamma = (1 - here[i, a] / (1.25 * near[-1])) / np.sum(1 - near / (1.25 * near[-1]))
        assert supports[i, j, a, b] == pytest.approx(alpha * beta * gamma, abs=1e-12)


def test_identical_sets_support_their_own_pairs_fully(warped: Warped) -> None:
    points = warped.source[:30]
    here = Neighbourhood.of(points, NEIGHBOURS)
    own = np.einsum("ijab,ab->ij", _whole_supports(here, here), np.eye(30))
    np.testing.assert_allclose(np.diag(own), 1.0, atol=1e-12)
    assert own.max() <= 1 + 1e-12


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("dimension", [2, 3], ids=["plane", "space"])
@pytest.mark.parametrize("updates", [1, 3, 30])
def test_no_point_of_either_set_is_given_away_more_than_once(dimension: int, seed: int, updates: int) -> None:
    source, target = _cluttered(dimension, seed)
    probability = _whole(_labels(source, target, updates), len(target))
    assert probability.min() >= 0
    assert probability.sum(axis=1).max() <= 1 + 1e-9
    assert probability.sum(axis=0).max() <= 1 + 1e-9


def test_two_points_that_want_one_partner_share_it() -> None:
    source = np.random.default_rng(0).normal(size=(12, 2))
    target = np.delete(source, 1, axis=0)
    source[1] = source[0] + 1e-3
    cost = np.where(np.linalg.norm(source[:, None] - target, axis=2) < 0.01, 0.0, 5.0)
    found = label(Neighbourhood.of(source, 6), Neighbourhood.of(target, 6), cost, single=ALONE)
    assert found.best[:2].tolist() == [0, 0]
    assert found.trust[:2].sum() <= 1 + 1e-9
    assert found.trust[2:].min() > 0.9


def test_a_smooth_deformation_is_labelled(warped: Warped) -> None:
    labels = _labels(warped.source, warped.target)
    assert warped.right(labels.best) > 0.95
    assert np.median(labels.trust) > 0.9


def test_permuting_the_target_permutes_the_labels(warped: Warped) -> None:
    order = np.random.default_rng(1).permutation(len(warped.target))
    one, other = _labels(warped.source, warped.target), _labels(warped.source, warped.target[order])
    np.testing.assert_array_equal(order[other.best], one.best)
    np.testing.assert_allclose(other.trust, one.trust, atol=1e-6)


def test_points_whose_partner_is_missing_are_trusted_less() -> None:
    source, target = _cluttered(2, 0)
    trust = _labels(source, target, updates=5).trust
    assert trust[:6].mean() < trust[6:].mean() - 0.2


def test_the_cheapest_columns_are_candidates() -> None:
    cost = np.random.default_rng(0).uniform(size=(9, 50))
    found = cheapest(cost, CANDIDATES)
    np.testing.assert_array_equal(np.sort(found), np.sort(np.argsort(cost, axis=1)[:, :CANDIDATES]))
    np.testing.assert_array_equal(np.sort(cheapest(cost[:, :5], CANDIDATES)), np.tile(np.arange(5), (9, 1)))


def test_neighbours_are_the_nearest_first() -> None:
    points = np.random.default_rng(2).normal(size=(15, 3))
    here = Neighbourhood.of(points, 6)
    distance = cdist(points, points)
    np.testing.assert_array_equal(here.index, np.argsort(distance, axis=1)[:, 1:7])
    np.testing.assert_allclose(np.exp(here.log_distance), np.sort(distance, axis=1)[:, 1:7])
    step = here.direction * np.exp(here.log_distance)[..., None]
    np.testing.assert_allclose(points[:, None] + step, points[here.index], atol=1e-12)
    np.testing.assert_allclose(here.nearness.sum(axis=1), 1.0)
    assert np.all(np.diff(here.nearness, axis=1) <= 0)


def test_of_fewer_points_than_neighbours_all_are_neighbours() -> None:
    assert Neighbourhood.of(np.random.default_rng(0).normal(size=(4, 2)), NEIGHBOURS).index.shape == (4, 3)
