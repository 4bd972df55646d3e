"""The network's derivatives against differences, and its answers against a loop over units."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.special import expit

from tsis.errors import InputError
from tsis.inclusion.network import Layers, Network
from tsis.inclusion.network._network import Span, activations, jacobian, mean_square

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
