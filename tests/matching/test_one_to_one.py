"""Pairs from costs: against every possible pairing, and what must hold of any."""

from __future__ import annotations

from itertools import permutations
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from tsis.matching import UNMATCHED
from tsis.matching._fit import assign, assign_sparse, nearest_pairs, spacing

if TYPE_CHECKING:
    from collections.abc import Callable

COSTS = arrays(float, st.tuples(st.integers(1, 4), st.integers(1, 4)), elements=st.floats(0, 2))


def _cheapest(cost: np.ndarray, dummy: float) -> float:
    """Least cost of any pairing, all of them tried; a row may also take a column of its own that costs ``dummy``."""
    n = len(cost)
    padded = np.hstack([cost, np.full((n, n), dummy)])
    return float(min(sum(padded[i, j] for i, j in enumerate(pick)) for pick in permutations(range(padded.shape[1]), n)))


def _assign_listed(cost: np.ndarray, *, dummy: float) -> np.ndarray:
    rows, columns = (each.ravel() for each in np.indices(cost.shape))
    return assign_sparse(rows, columns, cost.ravel(), cost.shape, dummy=dummy)


@pytest.mark.parametrize("method", [assign, _assign_listed])
@given(cost=COSTS, dummy=st.floats(0.1, 1.5))
def test_no_pairing_is_cheaper(method: Callable[..., np.ndarray], cost: np.ndarray, dummy: float) -> None:
    matches = method(cost, dummy=dummy)
    taken = matches[matches != UNMATCHED]
    assert len(set(taken)) == len(taken)
    paid = sum(dummy if j == UNMATCHED else cost[i, j] for i, j in enumerate(matches))
    assert paid == pytest.approx(_cheapest(cost, dummy))


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
