"""Training beside SciPy's minimisers on the same loss, and stopping by validation."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import least_squares, minimize

from tsis.errors import InputError, UnknownNameError
from tsis.inclusion.network import Layers, estimate_by_networks, train_network
from tsis.inclusion.network._network import activations, jacobian, mean_square


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
