"""Scaled conjugate gradients beside SciPy's minimisers and linear algebra."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.optimize import minimize, rosen, rosen_der

from tsis.inclusion.network._training import scaled_conjugate_gradient


def _bowl(size: int, condition: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    axes = np.linalg.qr(rng.standard_normal((size, size)))[0]
    return axes * np.geomspace(1.0, condition, size) @ axes.T, rng.standard_normal(size)


@given(size=st.integers(1, 20), condition=st.floats(1.0, 1e3), seed=st.integers(0, 1000))
def test_a_convex_quadratic_is_solved_as_by_linear_algebra(size: int, condition: float, seed: int) -> None:
    matrix, right = _bowl(size, condition, seed)
    least = 1e-5  # below it values differ by no more than rounding
    found = scaled_conjugate_gradient(
        lambda x: (0.5 * x @ matrix @ x - right @ x, matrix @ x - right), np.zeros(size), least_gradient=least
    )
    assert found.reason == "gradient"
    distance = np.linalg.norm(found.x - np.linalg.solve(matrix, right))
    assert distance <= 1.001 * least, "the least curvature is 1, so the gradient bounds the distance"


def test_on_a_quadratic_it_takes_about_as_many_steps_as_conjugate_gradients() -> None:
    matrix, right = _bowl(30, 100.0, 5)

    def value(x: np.ndarray) -> float:
        return float(0.5 * x @ matrix @ x - right @ x)

    def slope(x: np.ndarray) -> np.ndarray:
        return np.asarray(matrix @ x - right)

    peer = minimize(value, np.zeros(30), jac=slope, method="CG", options={"gtol": 1e-6, "norm": 2})
    found = scaled_conjugate_gradient(lambda x: (value(x), slope(x)), np.zeros(30))
    assert_allclose(found.x, peer.x, atol=1e-5)
    assert found.iterations <= peer.nit + 3


@pytest.mark.parametrize("size", [2, 6])
def test_rosenbrocks_valley_is_followed_to_the_minimum_that_bfgs_finds(size: int) -> None:
    start = np.full(size, -1.2)
    peer = minimize(rosen, start, jac=rosen_der, method="BFGS", options={"gtol": 1e-8})
    found = scaled_conjugate_gradient(lambda x: (rosen(x), rosen_der(x)), start, iterations=5000, least_gradient=1e-6)
    assert found.reason == "gradient"
    assert_allclose(found.x, peer.x, atol=1e-4)


def test_values_never_rise_and_directions_of_negative_curvature_are_left() -> None:
    seen = []

    def saddle(x: np.ndarray) -> tuple[float, np.ndarray]:
        return float(x[0] ** 2 - x[1] ** 2 + x[1] ** 4), np.array([2 * x[0], -2 * x[1] + 4 * x[1] ** 3])

    def note(x: np.ndarray) -> bool:
        seen.append(saddle(x)[0])
        return False

    found = scaled_conjugate_gradient(saddle, np.array([1.0, 1e-3]), stop=note)
    assert_allclose([found.value, abs(found.x[1])], [-0.25, np.sqrt(0.5)], atol=1e-9)
    assert (np.diff(seen) <= 0).all()


def test_a_caller_may_stop_it_and_steps_may_run_out() -> None:
    def stretched(x: np.ndarray) -> tuple[float, np.ndarray]:
        return float(x[0] ** 2 + 50 * x[1] ** 2), np.array([2 * x[0], 100 * x[1]])

    stopped = scaled_conjugate_gradient(stretched, np.array([3.0, 1.0]), stop=lambda _: True)
    assert (stopped.reason, stopped.iterations) == ("stopped", 1)
    assert stopped.value == stretched(stopped.x)[0]
    ran_out = scaled_conjugate_gradient(stretched, np.array([3.0, 1.0]), iterations=1)
    assert (ran_out.reason, ran_out.iterations) == ("iterations", 1)


def test_a_place_where_the_function_is_no_number_is_a_step_too_far() -> None:
    def walled(x: np.ndarray) -> tuple[float, np.ndarray]:
        beyond = x[0] >= 1.0
        value = np.nan if beyond else -np.log(1.0 - x[0]) - 5 * x[0]
        return float(value), np.array([np.nan if beyond else 1.0 / (1.0 - x[0]) - 5.0])

    found = scaled_conjugate_gradient(walled, np.array([0.0]))
    assert found.x[0] == pytest.approx(0.8)
