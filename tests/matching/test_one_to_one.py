"""Pairs from costs: against every possible pairing, and what must hold of any."""

from __future__ import annotations

from itertools import permutations
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import linear_sum_assignment
from scipy.spatial import KDTree, cKDTree
from scipy.spatial.distance import cdist

from tsis.matching.methods import UNMATCHED, assign, assign_listed, nearest_pairs, nearest_within, pairs_within, spacing
from tsis.matching.refinement import MANY_PAIRS, one_to_one

if TYPE_CHECKING:
    from collections.abc import Callable

COSTS = arrays(float, st.tuples(st.integers(1, 4), st.integers(1, 4)), elements=st.floats(0, 2))


def _cheapest(cost: np.ndarray, dummy: float) -> float:
    """Least cost of any pairing, all of them tried; a row may also take a column of its own that costs ``dummy``."""
    n = len(cost)
    padded = np.hstack([cost, np.full((n, n), dummy)])
    return float(min(sum(padded[i, j] for i, j in enumerate(pick)) for pick in permutations(range(padded.shape[1]), n)))


def _assign_listed(cost: np.ndarray, *, dummy: float) -> np.ndarray:
    rows, columns = cost.shape
    start, column = columns * np.arange(rows + 1), np.tile(np.arange(columns), rows)
    return assign_listed(start, column, cost.ravel(), columns, dummy)


@pytest.mark.parametrize("method", [assign, _assign_listed])
@given(cost=COSTS, dummy=st.floats(0.1, 1.5))
def test_no_pairing_is_cheaper(method: Callable[..., np.ndarray], cost: np.ndarray, dummy: float) -> None:
    matches = method(cost, dummy=dummy)
    taken = matches[matches != UNMATCHED]
    assert len(set(taken)) == len(taken)
    paid = sum(dummy if j == UNMATCHED else cost[i, j] for i, j in enumerate(matches))
    assert paid == pytest.approx(_cheapest(cost, dummy))


@pytest.mark.parametrize(("rows", "columns"), [(40, 60), (60, 40)])
@pytest.mark.parametrize("gate", [0.3, 1.0, 4.0])
def test_pairs_within_a_distance_are_those_of_the_whole_table(rows: int, columns: int, gate: float) -> None:
    rng = np.random.default_rng(1)
    moved, target = rng.normal(size=(rows, 2)), rng.normal(size=(columns, 2))
    cost = np.minimum(cdist(moved, target, "sqeuclidean"), gate**2)
    expected = np.full(rows, UNMATCHED)
    at, to = linear_sum_assignment(cost)
    expected[at] = np.where(cost[at, to] < gate**2, to, UNMATCHED)
    start, column, squared = pairs_within(moved, target, np.full(rows, gate))
    np.testing.assert_array_equal(assign_listed(start, column, squared, columns, gate**2), expected)


@pytest.mark.parametrize("dimension", [2, 3])
def test_nearest_within_a_distance_are_those_of_a_tree(dimension: int) -> None:
    rng = np.random.default_rng(2)
    points, target = rng.normal(size=(30, dimension)), rng.normal(size=(50, dimension))
    order = np.argsort(target[:, 0])
    near, away = nearest_within(points, target[order], order, 0.9, 5)
    expected, index = KDTree(target).query(points, k=5, distance_upper_bound=0.9)
    np.testing.assert_allclose(away, expected)
    np.testing.assert_array_equal(near, np.where(np.isinf(expected), UNMATCHED, index))


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize(("rows", "columns"), [(250, 400), (400, 250)])
@pytest.mark.parametrize("gate", [0.1, 0.3, 9.0])
def test_pairs_of_many_points_are_the_mutual_nearest_of_two_trees(
    dimension: int, rows: int, columns: int, gate: float
) -> None:
    assert rows * columns > MANY_PAIRS
    rng = np.random.default_rng([3, dimension, rows])
    moved, target = rng.normal(size=(rows, dimension)), rng.normal(size=(columns, dimension))
    away, nearest = (np.asarray(found) for found in cKDTree(target).query(moved))
    back = np.asarray(cKDTree(moved).query(target)[1])
    expected = np.where((back[nearest] == np.arange(rows)) & (away < gate), nearest, UNMATCHED)
    assert np.any(expected != UNMATCHED)
    np.testing.assert_array_equal(one_to_one(moved, target, gate), expected)


def test_many_points_out_of_reach_have_no_pair() -> None:
    points = np.random.default_rng(4).normal(size=(260, 2))
    assert np.all(one_to_one(points, points + 50.0, 1.0) == UNMATCHED)
    np.testing.assert_array_equal(one_to_one(points, points[::-1], 1e-6), np.arange(260)[::-1])


def test_permuting_the_target_permutes_the_matches() -> None:
    rng = np.random.default_rng(0)
    moved, target, order = rng.normal(size=(40, 3)), rng.normal(size=(50, 3)), rng.permutation(50)
    matches, trust = nearest_pairs(moved, target, tolerance=0.8)
    shuffled, same = nearest_pairs(moved, target[order], tolerance=0.8)
    assert 0 < np.sum(matches == UNMATCHED) < 40
    np.testing.assert_array_equal(np.where(shuffled == UNMATCHED, UNMATCHED, order[shuffled]), matches)
    np.testing.assert_allclose(same, trust, atol=1e-12)


def test_a_target_point_is_taken_once_and_trust_says_how_clear_the_choice_was() -> None:
    target = np.array([[0.0, 0.0], [5.0, 0.0], [5.2, 0.0]])
    moved = np.array([[0.01, 0.0], [0.02, 0.0], [5.05, 0.0], [9.0, 9.0]])
    matches, trust = nearest_pairs(moved, target, tolerance=1.0)
    assert matches.tolist() == [0, UNMATCHED, 1, UNMATCHED]
    assert trust[0] > 0.98 > 0.6 > trust[2] > 0.4
    assert trust[1] == trust[3] == 0


def test_spacing_is_the_step_of_a_grid_however_often_a_point_is_there() -> None:
    grid = np.array([[0.3 * i, 0.3 * j] for i in range(4) for j in range(5)])
    assert spacing(grid) == pytest.approx(0.3)
    assert spacing(np.repeat(grid, 3, axis=0)) == pytest.approx(0.3)
    assert spacing(np.array([[1.0, 2.0]])) == 0
