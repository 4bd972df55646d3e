"""What all methods share: known deformations, pairs from costs against every pairing, frames, samples of large sets."""

from __future__ import annotations

from itertools import permutations
from typing import TYPE_CHECKING

import numpy as np
import pytest
from benchmarks.matching.distort import even_texture, fourier_curve, tactile_surface
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import linear_sum_assignment
from scipy.spatial import KDTree
from scipy.spatial.distance import cdist

from tsis.matching import annealing, bayesian_drift, drift, methods, neighbourhoods, posterior, register, shape_context
from tsis.matching.methods import (
    UNMATCHED,
    NormalFrame,
    assign,
    assign_listed,
    drawn,
    mutual_nearest,
    nearest_pairs,
    nearest_within,
    pairs_within,
    ridge_solution,
    spacing,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from benchmarks.matching.distort import Shape
    from tests.matching.conftest import Warped

    from tsis.matching.methods import MatchMethod


# least share of right pairs, and largest errors of the source's points and of new ones between them
METHODS: dict[str, tuple[MatchMethod, float, float, float]] = {
    "shape-context": (shape_context.fit, 0.95, 0.05, 0.1),
    "rpm-lns": (neighbourhoods.fit, 0.95, 0.05, 0.1),
    "cpd": (drift.fit, 0.999, 0.02, 0.06),
    "bcpd": (bayesian_drift.fit, 0.999, 0.03, 0.1),
    "tps-rpm": (annealing.fit, 0.999, 0.02, 0.04),
    "tprl": (posterior.fit, 0.999, 1e-3, 0.04),
}


@pytest.mark.parametrize("method", METHODS)
def test_a_smooth_deformation_is_found_whatever_the_order_of_the_target(warped: Warped, method: str) -> None:
    fit, right, away, between_away = METHODS[method]
    found = fit(warped.source, warped.target, rng=np.random.default_rng(0))
    assert warped.right(found.matches) > right
    assert warped.rms(found.move(warped.source)) < away
    assert 0 < np.median(found.trust) <= found.trust.max() <= 1
    assert method != "cpd" or found.trust.min() > 0.9
    assert method != "rpm-lns" or np.median(found.trust) > 0.9
    between = (warped.source[:-1] + warped.source[1:]) / 2
    between = between[np.linalg.norm(between, axis=1) < 0.8]
    np.testing.assert_allclose(found.move(between), warped.goes(between), atol=between_away)
    order = np.random.default_rng(1).permutation(len(warped.target))
    other = fit(warped.source, warped.target[order], rng=np.random.default_rng(0))
    np.testing.assert_array_equal(np.where(other.matches < 0, UNMATCHED, order[other.matches]), found.matches)
    np.testing.assert_allclose(
        other.move(warped.source), found.move(warped.source), atol=1e-6 if method == "rpm-lns" else 1e-7
    )


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


@pytest.mark.parametrize("dimension", [2, 3], ids=["plane", "space"])
@given(seed=st.integers(0, 2**31), size=st.sampled_from([1e-9, 1.0, 1e9]), away=st.floats(-1e3, 1e3))
def test_inside_points_are_centred_and_of_unit_size(dimension: int, seed: int, size: float, away: float) -> None:
    points = size * (np.random.default_rng(seed).normal(size=(9, dimension)) + away)
    frame = NormalFrame.of(points)
    inside = frame.inward(points)
    np.testing.assert_allclose(inside.mean(axis=0), 0.0, atol=1e-9)
    assert np.mean(np.sum(inside**2, axis=1)) == pytest.approx(1.0)
    np.testing.assert_allclose(frame.outward(inside) / size, points / size, atol=1e-9)


def test_moving_and_scaling_leave_nothing_inside() -> None:
    points = np.random.default_rng(0).normal(size=(30, 3))
    moved = 7.0 * points + [1.0, -2.0, 30.0]
    np.testing.assert_allclose(NormalFrame.of(moved).inward(moved), NormalFrame.of(points).inward(points), atol=1e-12)
    assert NormalFrame.of(moved).size == pytest.approx(7 * NormalFrame.of(points).size)


@pytest.mark.parametrize("ridge", [0.3, np.array([0.3, 2.0, 1e-3, 0.5, 1.0])])
def test_a_ridge_is_least_squares_with_a_row_more_a_coordinate(ridge: float | np.ndarray) -> None:
    rng = np.random.default_rng(5)
    design, values = rng.normal(size=(40, 5)), rng.normal(size=(40, 2))
    rows = np.vstack([design, np.diag(np.sqrt(np.broadcast_to(ridge, 5)))])
    expected, *_ = np.linalg.lstsq(rows, np.vstack([values, np.zeros((5, 2))]))
    found = ridge_solution(design.T @ design, design.T @ values, ridge)
    np.testing.assert_allclose(found, expected, rtol=1e-11)


STATED = 0.05  # of the extent of the shape: what the transform of a sample may be wrong by at most
FEWEST_RIGHT = 0.5  # of the matches, where the sample of the target holds all of it


def _warped(points: np.ndarray) -> np.ndarray:
    return np.asarray(points + 0.08 * np.sin(3 * points[:, ::-1] + np.arange(points.shape[1])))


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sets of 400 are large; 150 of the source are a sample, and up to 600 of the target."""
    monkeypatch.setattr(methods, "MOST_PAIRS", 90_000)
    monkeypatch.setattr(methods, "SAMPLE", 150)


@pytest.mark.parametrize("method", ["tprl", pytest.param("tps-rpm", marks=pytest.mark.slow)])
@pytest.mark.parametrize("shape", [even_texture, pytest.param(fourier_curve, marks=pytest.mark.slow), tactile_surface])
@pytest.mark.usefixtures("few")
def test_the_transform_of_a_sample_moves_all(shape: Shape, method: str) -> None:
    rng = np.random.default_rng(0)
    source = shape(400, rng=rng)
    order = rng.permutation(400)
    found = register(source, _warped(source)[order], method=method)
    assert found.notes == (
        "400 and 400 points are too many for tables of all pairs; 150 and 400 drawn from them were matched",
    )
    assert np.sqrt(np.mean(np.sum((found.moved - _warped(source)) ** 2, axis=1))) < STATED * np.ptp(source)
    made = found.matches != UNMATCHED
    matched = found.matches[made]
    assert len(set(matched)) == len(matched) > 150
    assert np.mean(order[matched] == np.flatnonzero(made)) > FEWEST_RIGHT


@pytest.mark.usefixtures("few")
def test_a_target_too_large_for_the_table_is_drawn_from_as_well() -> None:
    rng = np.random.default_rng(0)
    source = fourier_curve(1200, rng=rng)
    found = register(source, _warped(source)[rng.permutation(1200)], method="tps-rpm")
    assert "150 and 600 drawn from them" in found.notes[0]
    assert np.sqrt(np.mean(np.sum((found.moved - _warped(source)) ** 2, axis=1))) < STATED * np.ptp(source)


@pytest.mark.usefixtures("few")
def test_what_is_not_large_is_not_sampled() -> None:
    source = even_texture(80, rng=np.random.default_rng(0))
    assert register(source, _warped(source), method="tps-rpm").notes == ()
    chance, source = np.random.default_rng(0), np.zeros((1000, 2))
    assert drawn(source, np.zeros((90, 2)), rng=chance)[0] is source
    assert len(drawn(source, np.zeros((91, 2)), rng=chance)[0]) == 150


@pytest.mark.usefixtures("few")
def test_the_same_chance_draws_the_same_sample() -> None:
    points = even_texture(400, rng=np.random.default_rng(0))
    one, other, third = (drawn(points, points, rng=np.random.default_rng(seed))[0] for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, other)
    assert np.any(one != third)


def test_mutual_nearest_equal_those_of_the_whole_table() -> None:
    rng = np.random.default_rng(0)
    moved, target = rng.uniform(size=(60, 2)), rng.uniform(size=(70, 2))
    distance = cdist(moved, target)
    step = np.median(np.sort(cdist(target, target))[:, 1])
    matches, trust = mutual_nearest(moved, target)
    for i, j in enumerate(distance.argmin(axis=1)):
        mutual = distance[:, j].argmin() == i and distance[i, j] <= step / 2
        assert matches[i] == (j if mutual else UNMATCHED)
        assert trust[i] == pytest.approx(1 - distance[i, j] / step if mutual else 0.0)
    assert 0 < np.sum(matches == UNMATCHED) < 60


def test_points_given_twice_count_once_in_the_spacing() -> None:
    grid = np.stack(np.meshgrid(np.arange(5.0), np.arange(5.0)), axis=-1).reshape(-1, 2)
    matches, trust = mutual_nearest(grid + 0.1, np.repeat(grid, 2, axis=0))
    np.testing.assert_array_equal(matches // 2, np.arange(25))
    assert trust.min() > 0.5
