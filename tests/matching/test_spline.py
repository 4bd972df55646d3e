"""Splines: against SciPy's, against differences, and what the minimum of a bending energy must obey."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import RBFInterpolator
from scipy.spatial.transform import Rotation

from tsis.errors import InputError
from tsis.matching.spline import CONTROL_POINTS, ThinPlateSpline, fit_spline, spline_basis, spread_indices

PEER: dict[int, Literal["thin_plate_spline", "linear"]] = {2: "thin_plate_spline", 3: "linear"}
DIMENSIONS = pytest.mark.parametrize("dimension", [2, 3], ids=["plane", "space"])


def _pairs(dimension: int, count: int = 50, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points, bent and sheared targets, and places to ask at, some of them outside."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(count, dimension))
    return (
        points,
        np.sin(points) + points @ rng.normal(size=(dimension, dimension)),
        2 * rng.normal(size=(20, dimension)),
    )


@DIMENSIONS
@pytest.mark.parametrize("bending", [0.0, 1e-3, 0.1, 10.0])
def test_equals_that_of_scipy(dimension: int, bending: float) -> None:
    points, targets, asked = _pairs(dimension)
    peer = RBFInterpolator(points, targets, kernel=PEER[dimension], degree=1, smoothing=bending)
    np.testing.assert_allclose(fit_spline(points, targets, bending=bending)(asked), peer(asked), atol=1e-7)


@DIMENSIONS
@pytest.mark.parametrize("bending", [0.0, 0.1])
def test_weights_are_what_scipy_calls_smoothing_point_by_point(dimension: int, bending: float) -> None:
    points, targets, asked = _pairs(dimension)
    weights = np.random.default_rng(1).uniform(0.1, 3.0, len(points))
    peer = RBFInterpolator(points, targets, kernel=PEER[dimension], degree=1, smoothing=bending / weights)
    found = fit_spline(points, targets, bending=bending, weights=weights)
    np.testing.assert_allclose(found(asked), peer(asked), atol=1e-7)


@DIMENSIONS
@pytest.mark.parametrize("bending", [0.0, 0.1])
def test_a_point_without_weight_is_as_good_as_absent(dimension: int, bending: float) -> None:
    points, targets, asked = _pairs(dimension)
    weights = np.where(np.arange(len(points)) % 3 == 0, 0.0, 2.0)
    wild = np.where(weights[:, None] == 0, 1e3, targets)
    found = fit_spline(points, wild, bending=bending, weights=weights)
    kept = fit_spline(points[weights > 0], targets[weights > 0], bending=bending / 2)
    np.testing.assert_allclose(found(asked), kept(asked), atol=1e-7)


@DIMENSIONS
def test_gradient_equals_differences(dimension: int) -> None:
    points, targets, asked = _pairs(dimension)
    spline, step = fit_spline(points, targets, bending=1e-3), 1e-5
    gradient = spline.gradient(asked)
    for axis in range(dimension):
        shift = step * np.eye(dimension)[axis]
        difference = (spline(asked + shift) - spline(asked - shift)) / (2 * step)
        np.testing.assert_allclose(gradient[:, :, axis], difference, atol=1e-6)


@DIMENSIONS
@settings(max_examples=15)
@given(seed=st.integers(0, 2**31), bending=st.sampled_from([0.0, 1e-2, 1e2]))
def test_an_affine_map_is_reproduced_and_bends_nothing(dimension: int, seed: int, bending: float) -> None:
    points, _, asked = _pairs(dimension, 12, seed)
    matrix = np.random.default_rng(seed).normal(size=(dimension, dimension))
    spline = fit_spline(points, points @ matrix + 3.0, bending=bending)
    np.testing.assert_allclose(spline(asked), asked @ matrix + 3.0, atol=1e-6)
    assert spline.bending_energy == pytest.approx(0.0, abs=1e-9)


@DIMENSIONS
@settings(max_examples=15)
@given(seed=st.integers(0, 2**31), size=st.sampled_from([1e-9, 1.0, 1e5]), away=st.sampled_from([0.0, 1e4]))
def test_turning_moving_and_scaling_carry_over(dimension: int, seed: int, size: float, away: float) -> None:
    points, targets, asked = _pairs(dimension)
    turn = Rotation.random(rng=seed).as_matrix() if dimension == 3 else _turn(seed)
    shift = size * away

    def there(places: np.ndarray) -> np.ndarray:
        return np.asarray(size * places @ turn + shift)

    plain = fit_spline(points, targets, bending=0.01)
    moved = fit_spline(there(points), there(targets), bending=0.01 * size ** (4 - dimension))
    np.testing.assert_allclose(moved(there(asked)) / size, there(plain(asked)) / size, atol=1e-6)


def _turn(angle: float) -> np.ndarray:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


@DIMENSIONS
def test_bending_energy_falls_and_misfit_grows_with_bending(dimension: int) -> None:
    points, targets, _ = _pairs(dimension)
    splines = [fit_spline(points, targets, bending=bending) for bending in np.logspace(-6, 4, 11)]
    energy = [spline.bending_energy for spline in splines]
    misfit = [float(np.sum((spline(points) - targets) ** 2)) for spline in splines]
    assert np.all(np.diff(energy) < 0)
    assert np.all(np.diff(misfit) > 0)
    assert energy[-1] >= 0


@DIMENSIONS
@pytest.mark.parametrize("bending", [1e-3, 1.0])
def test_no_spline_near_by_costs_less(dimension: int, bending: float) -> None:
    points, targets, _ = _pairs(dimension)

    def cost(spline: ThinPlateSpline) -> float:
        return float(np.sum((spline(points) - targets) ** 2) + bending * spline.bending_energy)

    found, rng = fit_spline(points, targets, bending=bending), np.random.default_rng(2)
    for _ in range(10):
        other = fit_spline(points, targets + 0.1 * rng.normal(size=targets.shape), bending=bending)
        assert cost(other) > cost(found)


@DIMENSIONS
def test_coordinates_make_the_bending_energy_a_sum_of_squares(dimension: int) -> None:
    points, targets, _ = _pairs(dimension)
    basis = spline_basis(points)
    coordinates = basis.coordinates(targets, bending=1e-2)
    spline = basis.spline(coordinates)
    assert spline.bending_energy == pytest.approx(float(np.sum(coordinates[: basis.bent] ** 2)), rel=1e-6)
    np.testing.assert_allclose(basis.design @ coordinates, spline(points), atol=1e-8)
    np.testing.assert_allclose(spline.weights.sum(axis=0), 0.0, atol=1e-8)
    np.testing.assert_allclose(spline.control.T @ spline.weights, 0.0, atol=1e-8)
    np.testing.assert_allclose(basis.spline(basis.rest)(points), points, atol=1e-12)


@DIMENSIONS
def test_many_points_share_few_control_points(dimension: int) -> None:
    points, targets, _ = _pairs(dimension, 1500)
    spline = fit_spline(points, targets, bending=1e-6)
    assert len(spline.control) == CONTROL_POINTS <= 300
    inside = np.linalg.norm(points, axis=1) < 1.5
    assert np.sqrt(np.mean((spline(points) - targets)[inside] ** 2)) < 0.02


@DIMENSIONS
def test_points_given_twice_go_to_the_mean_of_their_targets(dimension: int) -> None:
    points, targets, _ = _pairs(dimension)
    spline = fit_spline(np.vstack([points, points]), np.vstack([targets - 0.1, targets + 0.1]))
    np.testing.assert_allclose(spline(points), targets, atol=1e-7)
    assert len(spline.control) == len(points)


def test_control_points_are_spread_and_distinct() -> None:
    grid = np.stack(np.meshgrid(np.arange(5.0), np.arange(5.0)), axis=-1).reshape(-1, 2)
    twice = np.repeat(grid, 2, axis=0)
    assert len(spread_indices(twice, 100)) == len(np.unique(twice[spread_indices(twice, 100)], axis=0)) == 25
    corners = twice[spread_indices(twice, 5)]
    assert {(0.0, 0.0), (0.0, 4.0), (4.0, 0.0), (4.0, 4.0)} < {(x, y) for x, y in corners.tolist()}


LINE = np.outer(np.arange(6.0), [1.0, 2.0])
SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"points": LINE, "targets": LINE}, "not in a line"),
        ({"points": 1e9 + LINE, "targets": LINE}, "not in a line"),
        ({"points": np.column_stack([LINE, LINE @ [1.0, 1.0]]), "targets": np.zeros((6, 3))}, "not in a plane"),
        (
            {"points": np.vstack([SQUARE * [1, 1], SQUARE[:1]]) @ np.eye(2, 3), "targets": np.zeros((5, 3))},
            "not in a pl",
        ),
        ({"points": SQUARE[:2], "targets": SQUARE[:2]}, "at least 3"),
        (
            {"points": np.ones((5, 2)), "targets": np.ones((5, 2))},
            "at least 3 points must be distinct; got 5 equal ones",
        ),
        ({"points": SQUARE, "targets": SQUARE[:3]}, "targets must be as many as the points, 4; got 3"),
        ({"points": SQUARE, "targets": np.zeros((4, 3))}, "targets must have 2 coordinates"),
        ({"points": np.zeros((4, 4)), "targets": np.zeros((4, 4))}, "points must have 2 or 3 coordinates"),
        ({"points": SQUARE, "targets": SQUARE, "bending": -1.0}, "bending must lie in"),
        ({"points": SQUARE, "targets": SQUARE, "weights": [1, 1, 1]}, "weights must be 4 numbers"),
        ({"points": SQUARE, "targets": SQUARE, "weights": [1, 1, 1, -1]}, "not negative"),
        ({"points": SQUARE, "targets": SQUARE, "weights": [0, 0, 0, 0]}, "one of them positive"),
        ({"points": SQUARE, "targets": SQUARE, "weights": [1, 1, 0, 0]}, "at least 3"),
        ({"points": SQUARE, "targets": np.where(SQUARE == 1, np.nan, 0)}, "targets must be finite"),
        (
            {"points": SQUARE, "targets": SQUARE, "control": np.vstack([SQUARE, [[5.0, 5.0]]])},
            "bending must be positive",
        ),
    ],
)
def test_what_determines_no_spline_is_refused(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        fit_spline(**arguments)  # type: ignore[arg-type]


def test_more_control_points_than_points_need_bending_and_then_agree_with_fewer() -> None:
    points, targets, asked = _pairs(2)
    more = np.vstack([points, asked])
    found = fit_spline(points, targets, bending=0.1, control=more)
    np.testing.assert_allclose(found(asked), fit_spline(points, targets, bending=0.1)(asked), atol=1e-6)


@pytest.mark.parametrize("call", ["__call__", "gradient"])
def test_a_spline_of_the_plane_takes_no_points_of_space(call: str) -> None:
    spline = fit_spline(SQUARE, SQUARE)
    with pytest.raises(InputError, match="points must have 2 coordinates"):
        getattr(spline, call)(np.zeros((3, 3)))


def test_each_spread_point_is_the_farthest_from_those_before_it() -> None:
    points = np.random.default_rng(5).normal(size=(60, 2))
    chosen = spread_indices(points, 20)
    for step in range(1, 20):
        away = np.linalg.norm(points[:, None] - points[chosen[:step]], axis=2).min(axis=1)
        assert away[chosen[step]] == pytest.approx(away.max(), rel=1e-12)
