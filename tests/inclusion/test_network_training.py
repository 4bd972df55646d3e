"""Networks: derivatives against differences, descent and training beside SciPy's minimisers, stopping by validation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.optimize import least_squares, minimize, rosen, rosen_der
from scipy.special import expit

from tsis.errors import InputError, UnknownNameError
from tsis.inclusion.network_training import (
    Layers,
    Network,
    Span,
    activations,
    estimate_by_networks,
    jacobian,
    mean_square,
    scaled_conjugate_gradient,
    train_network,
)

shapes = st.builds(
    Layers,
    inputs=st.integers(1, 4),
    hidden=st.lists(st.integers(1, 6), max_size=3).map(tuple),
    outputs=st.integers(1, 4),
)


def _problem(layers: Layers, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    weights = rng.standard_normal(layers.weights)
    return weights, rng.standard_normal((7, layers.inputs)), rng.standard_normal((7, layers.outputs))


def test_the_sources_shape_has_as_many_weights_as_its_figure_has_lines_and_biases() -> None:
    assert Layers(inputs=3, hidden=(10,), outputs=3).weights == 10 * 3 + 10 + 3 * 10 + 3


def test_answers_are_those_of_a_loop_over_units() -> None:
    layers = Layers(inputs=2, hidden=(3, 2), outputs=1)
    weights, inputs, _ = _problem(layers, 3)
    matrices = layers.matrices(weights)
    for x, answer in zip(inputs, activations(layers, weights, inputs)[-1], strict=True):
        values = list(x)
        for level, matrix in enumerate(matrices):
            sums = [sum(w * v for w, v in zip(row[:-1], values, strict=True)) + row[-1] for row in matrix]
            values = sums if level == len(matrices) - 1 else [expit(one) for one in sums]
        assert_allclose(answer, values, rtol=1e-12)


@given(layers=shapes, seed=st.integers(0, 1000))
def test_the_gradient_is_that_of_differences(layers: Layers, seed: int) -> None:
    weights, inputs, targets = _problem(layers, seed)
    value, gradient = mean_square(layers, weights, inputs, targets)
    assert value == pytest.approx(np.mean((activations(layers, weights, inputs)[-1] - targets) ** 2))
    step = 1e-5
    for k in range(layers.weights):
        ends = [mean_square(layers, weights + s * np.eye(layers.weights)[k], inputs, targets)[0] for s in (step, -step)]
        assert gradient[k] == pytest.approx((ends[0] - ends[1]) / (2 * step), rel=1e-6, abs=1e-8)


@given(layers=shapes, seed=st.integers(0, 1000))
def test_the_jacobian_is_that_of_differences_and_makes_the_gradient(layers: Layers, seed: int) -> None:
    weights, inputs, targets = _problem(layers, seed)
    found = jacobian(layers, weights, inputs)
    assert found.shape == (len(inputs), layers.outputs, layers.weights)
    for k, step in enumerate(1e-5 * np.eye(layers.weights)):
        ends = [activations(layers, weights + sign * step, inputs)[-1] for sign in (1, -1)]
        assert_allclose(found[..., k], (ends[0] - ends[1]) / 2e-5, atol=1e-8)
    residual = activations(layers, weights, inputs)[-1] - targets
    by_chain = 2 * np.einsum("nk,nkw->w", residual, found) / residual.size
    assert_allclose(mean_square(layers, weights, inputs, targets)[1], by_chain, atol=1e-12)


def test_units_far_from_zero_saturate_and_do_not_overflow() -> None:
    layers = Layers(inputs=1, hidden=(1,), outputs=1)
    weights = np.array([1e6, 0.0, 2.0, 1.0])  # slope, bias; slope, bias of the linear unit
    assert_allclose(activations(layers, weights, np.array([[1.0], [-1.0]]))[-1], [[3.0], [1.0]])


@given(st.integers(0, 1000))
def test_spans_turn_back_and_have_their_ends_at_one(seed: int) -> None:
    table = np.random.default_rng(seed).normal(5.0, 3.0, (6, 2))
    span = Span.of("table", table)
    inside = span.inwards(table)
    assert_allclose(inside.min(axis=0), -1)
    assert_allclose(inside.max(axis=0), 1)
    assert_allclose(span.outwards(inside), table)


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(InputError, match="units of a layer"):
        Layers(inputs=3, hidden=(0,), outputs=3)
    with pytest.raises(InputError, match="whole number"):
        Layers(inputs=3, hidden=(2.5,), outputs=3)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="fewer layers"):
        Layers(inputs=3, hidden=(1000,) * 12, outputs=3)
    with pytest.raises(InputError, match="must vary"):
        Span.of("inputs", np.ones((4, 2)))
    layers, span = Layers(inputs=1, hidden=(), outputs=1), Span(low=np.zeros(1), high=np.ones(1))
    network = Network(layers=layers, weights=np.array([1.0, 0.0]), input_span=span, output_span=span)
    assert_allclose(network([[0.25]]), [[0.25]])
    with pytest.raises(InputError, match="1 columns"):
        network([[1.0, 2.0]])
    with pytest.raises(InputError, match="finite"):
        network([[np.nan]])


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


@pytest.fixture
def samples() -> tuple[np.ndarray, np.ndarray]:
    """A smooth map that ten units can nearly follow, and noise that nobody can."""
    rng = np.random.default_rng(6)
    x = rng.uniform([0.0, 10.0, -5.0], [2.0, 30.0, 5.0], (134, 3))
    y = np.column_stack([np.sin(2 * x[:, 0]) * x[:, 2], x[:, 1] ** 2 / 50, 40.0 + x.sum(axis=1)])
    return x, y + rng.normal(0.0, 0.2, y.shape) * y.std(axis=0)


def _scaled(table: np.ndarray) -> np.ndarray:
    low, high = table.min(axis=0), table.max(axis=0)
    return np.asarray(2 * (table - low) / (high - low) - 1)


def test_conjugate_gradients_reach_the_loss_that_scipys_do(samples: tuple[np.ndarray, np.ndarray]) -> None:
    layers, (x, y) = Layers(inputs=3, hidden=(10,), outputs=3), map(_scaled, samples)
    start = layers.random_weights(np.random.default_rng(1))  # what the training draws from the same seed
    network, training = train_network(*samples, rng=np.random.default_rng(1), iterations=400)

    def value(weights: np.ndarray) -> float:
        return mean_square(layers, weights, x, y)[0]

    def slope(weights: np.ndarray) -> np.ndarray:
        return mean_square(layers, weights, x, y)[1]

    peers = [
        float(minimize(value, start, jac=slope, method="CG", options={"maxiter": 400}).fun),
        float(minimize(value, start, jac=slope, method="L-BFGS-B", options={"maxiter": 400}).fun),
    ]
    assert training.error == pytest.approx(mean_square(layers, network.weights, x, y)[0])
    assert min(peers) * 0.9 < training.error < max(peers) * 1.1
    assert training.error < 0.2 * mean_square(layers, start, x, y)[0]


def test_levenberg_marquardt_reaches_the_loss_of_scipys_trust_region(samples: tuple[np.ndarray, np.ndarray]) -> None:
    x, y = (table[:60] for table in map(_scaled, samples))
    x, y = _scaled(x), _scaled(y[:, :1])
    layers = Layers(inputs=3, hidden=(3,), outputs=1)
    start = layers.random_weights(np.random.default_rng(2))

    def residual(weights: np.ndarray) -> np.ndarray:
        return np.asarray((activations(layers, weights, x)[-1] - y).ravel())

    def slopes(weights: np.ndarray) -> np.ndarray:
        return jacobian(layers, weights, x).reshape(y.size, -1)

    peer = least_squares(residual, start, jac=slopes, method="trf", max_nfev=3000)
    _, training = train_network(x, y, rng=np.random.default_rng(2), hidden=(3,), method="lm")
    assert training.error == pytest.approx(2 * peer.cost / y.size, rel=0.05)


def test_levenberg_marquardt_goes_further_down_than_conjugate_gradients(
    samples: tuple[np.ndarray, np.ndarray],
) -> None:
    errors = {
        method: train_network(*samples, rng=np.random.default_rng(3), method=method, iterations=200)[1].error
        for method in ("scg", "lm")
    }
    assert errors["lm"] < errors["scg"]


@pytest.mark.parametrize("method", ["scg", "lm"])
def test_validation_keeps_the_weights_that_it_liked_best(samples: tuple[np.ndarray, np.ndarray], method: str) -> None:
    x, y = samples
    seen, held = (x[:30], y[:30]), (x[30:], y[30:])
    network, training = train_network(*seen, rng=np.random.default_rng(4), validation=held, method=method, patience=60)
    low, high = seen[1].min(axis=0), seen[1].max(axis=0)
    error = np.mean((2 * (network(held[0]) - held[1]) / (high - low)) ** 2)
    assert training.reason == "validation"
    assert training.validation_error == pytest.approx(error)
    to_the_end, longer = train_network(*seen, rng=np.random.default_rng(4), method=method, iterations=400)
    late = np.mean((2 * (to_the_end(held[0]) - held[1]) / (high - low)) ** 2)
    assert error < late, "trained to the end it follows the noise"
    assert longer.error < training.error
    assert longer.validation_error is None


@pytest.mark.parametrize("method", ["scg", "lm"])
def test_patience_and_iterations_bound_the_steps(samples: tuple[np.ndarray, np.ndarray], method: str) -> None:
    x, y = samples
    one = train_network(x, y, rng=np.random.default_rng(0), method=method, iterations=1)[1]
    assert (one.steps, one.reason) == (1, "iterations")
    steps = [
        train_network(x[9:], y[9:], rng=np.random.default_rng(0), validation=(x[:9], y[:9]), method=m, patience=p)[1]
        for m, p in ((method, 1), (method, 30))
    ]
    assert steps[0].steps < steps[1].steps
    assert steps[0].validation_error >= steps[1].validation_error  # type: ignore[operator]


def test_a_layer_between_may_be_given(samples: tuple[np.ndarray, np.ndarray]) -> None:
    network, _ = train_network(*samples, rng=np.random.default_rng(0), hidden=(10, 4), iterations=50)
    assert network.layers.sizes == (3, 10, 4, 3)


def test_units_of_the_samples_do_not_matter(samples: tuple[np.ndarray, np.ndarray]) -> None:
    x, y = samples
    here, _ = train_network(x, y, rng=np.random.default_rng(5), iterations=20)
    there, _ = train_network(1000 * x - 3, 0.1 * y + 7, rng=np.random.default_rng(5), iterations=20)
    assert_allclose(there(1000 * x - 3), 0.1 * here(x) + 7, rtol=1e-6)


def test_samples_that_cannot_train_are_refused(samples: tuple[np.ndarray, np.ndarray]) -> None:
    x, y = samples
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match="patience must lie in"):
        train_network(x, y, rng=rng, patience=1_000_001)
    with pytest.raises(InputError, match="as many rows"):
        train_network(x, y[:-1], rng=rng)
    with pytest.raises(InputError, match="73 values"):
        train_network(x[:20], y[:20], rng=rng, method="lm")
    with pytest.raises(InputError, match="columns"):
        train_network(x, y, rng=rng, validation=(x[:, :2], y))
    with pytest.raises(InputError, match="must vary"):
        train_network(x, np.ones_like(y), rng=rng)
    with pytest.raises(UnknownNameError, match="scg"):
        train_network(x, y, rng=rng, method="sgc")
    with pytest.raises(InputError, match="Jacobian"):
        train_network(np.tile(x, (40, 1)), np.tile(y, (40, 1)), rng=rng, method="lm", hidden=(1000,))
    with pytest.raises(InputError, match=r"like \(10,\)"):
        train_network(x, y, rng=rng, hidden=10)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="pair"):
        train_network(x, y, rng=rng, validation=x)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="at most 5e"):
        estimate_by_networks(x, y, np.ones((1000, 3)), rng=rng, trials=100_000)
    with pytest.raises(InputError, match="two samples must be left"):
        estimate_by_networks(x, y, x, rng=rng, validated=len(x))


def test_trials_differ_are_counted_and_come_again_with_their_seed(samples: tuple[np.ndarray, np.ndarray]) -> None:
    x, y = samples
    calls: list[tuple[int, int]] = []
    first = estimate_by_networks(
        x, y, x[:5], rng=np.random.default_rng(8), trials=3, progress=lambda *now: calls.append(now)
    )
    assert first.shape == (3, 5, 3)
    assert calls == [(1, 3), (2, 3), (3, 3)]
    assert (np.abs(np.diff(first, axis=0)) > 1e-6).all()
    assert_allclose(estimate_by_networks(x, y, x[:5], rng=np.random.default_rng(8), trials=3), first)
