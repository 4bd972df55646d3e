"""A feed-forward network of sigmoid units with a linear output layer, and exact derivatives by its weights.

The dissertation's network has three inputs, ten sigmoid units and three linear units (section 6.3.3). It names a layer
between them without its size; ``hidden`` may include one.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import InputError
from tsis.model import ContentValue, require_array, require_number

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import ArrayLike

    from tsis.inclusion._prior import Floats


MOST_UNITS = 1000  # of a layer
ROUNDING = 1e-12  # relative variation that sums may have by their order alone
MOST_WEIGHTS = 10_000_000  # 80 MB, with some copies in training


@dataclass(frozen=True, slots=True, kw_only=True)
class Layers:
    """Numbers of inputs, hidden units of each layer, and outputs: the layout of a flat array of weights.

    Examples
    --------
    >>> Layers(inputs=3, hidden=(10,), outputs=3).weights
    73
    """

    inputs: int
    hidden: tuple[int, ...]
    outputs: int

    def __post_init__(self) -> None:
        for name, size in (("inputs", self.inputs), ("outputs", self.outputs), *(("hidden", n) for n in self.hidden)):
            if size != int(require_number(name, size, 1, MOST_UNITS, hint="units of a layer")):
                raise InputError(f"{name} must be a whole number of units; got {size!r}")
        if self.weights > MOST_WEIGHTS:
            raise InputError(f"a network must have at most {MOST_WEIGHTS} weights; got {self.weights} (fewer layers)")

    @property
    def sizes(self) -> tuple[int, ...]:
        """Units of every layer, the inputs first."""
        return (self.inputs, *self.hidden, self.outputs)

    @property
    def weights(self) -> int:
        """Number of weights and biases."""
        return sum((below + 1) * above for below, above in pairwise(self.sizes))

    def matrices(self, weights: Floats) -> list[Floats]:
        """One matrix a layer, shape (units, units below + 1); the last column is the bias."""
        result, start = [], 0
        for below, above in pairwise(self.sizes):
            size = (below + 1) * above
            result.append(weights[start : start + size].reshape(above, below + 1))
            start += size
        return result

    def random_weights(self, rng: np.random.Generator) -> Floats:
        """Normal weights that preserve the variance from layer to layer, and zero biases."""
        parts = []
        for below, above in pairwise(self.sizes):
            matrix = np.zeros((above, below + 1))
            matrix[:, :-1] = rng.standard_normal((above, below)) / np.sqrt(below)
            parts.append(matrix.ravel())
        return np.concatenate(parts)


def activations(layers: Layers, weights: Floats, inputs: Floats) -> list[Floats]:
    """Values of all layers, shape (n, units) each, from the inputs to the outputs."""
    *hidden, last = layers.matrices(weights)
    results = [inputs]
    for matrix in hidden:
        # tanh overflows nowhere: 1 / (1 + exp(-z)) = (1 + tanh(z / 2)) / 2
        results.append(0.5 + 0.5 * np.tanh(0.5 * (results[-1] @ matrix[:, :-1].T + matrix[:, -1])))
    results.append(results[-1] @ last[:, :-1].T + last[:, -1])
    return results


def mean_square(layers: Layers, weights: Floats, inputs: Floats, targets: Floats) -> tuple[float, Floats]:
    """Mean square error over samples and outputs, and its gradient by the weights."""
    findings = activations(layers, weights, inputs)
    residual = findings[-1] - targets
    error = (2.0 / residual.size) * residual[:, None, :]
    gradient = [
        np.append(change[:, 0].T @ below, change[:, 0].sum(axis=0)[:, None], axis=1).ravel()
        for change, below in _backwards(layers, weights, findings, error)
    ]
    return float(np.mean(residual**2)), np.concatenate(gradient[::-1])


def jacobian(layers: Layers, weights: Floats, inputs: Floats) -> Floats:
    """Derivatives of the outputs by the weights, shape (n, outputs, weights)."""
    findings = activations(layers, weights, inputs)
    every = np.broadcast_to(np.eye(layers.outputs), (len(inputs), layers.outputs, layers.outputs))
    parts = []
    for change, below in _backwards(layers, weights, findings, every):
        with_bias = np.append(below, np.ones((len(below), 1)), axis=1)
        parts.append((change[..., None] * with_bias[:, None, None, :]).reshape(*change.shape[:2], -1))
    return np.concatenate(parts[::-1], axis=-1)


def _backwards(
    layers: Layers, weights: Floats, messages: list[Floats], at_outputs: Floats
) -> Iterator[tuple[Floats, Floats]]:
    """Backpropagate: from the last layer, derivatives by its units' sums, (n, k, units), and its inputs.

    ``at_outputs``, shape (n, k, outputs), is k directions in the outputs of each sample.
    """
    change = at_outputs
    for matrix, below in zip(reversed(layers.matrices(weights)), reversed(messages[:-1]), strict=True):
        yield change, below
        change = (change @ matrix[:, :-1]) * (below * (1.0 - below))[:, None, :]


def check_varies(name: str, values: Floats) -> None:
    """Refuse a table of shape (n, columns) with a column that is constant within rounding."""
    if (np.ptp(values, axis=0) <= ROUNDING * np.abs(values).max(axis=0)).any():
        raise InputError(f"{name} must vary in every column; got one that is the same in all {len(values)} rows")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Span(ContentValue):
    """Least and greatest value of each column, scaled to -1 and 1 in a network; shapes (columns,)."""

    low: Floats
    high: Floats

    @classmethod
    def of(cls, name: str, values: Floats) -> Span:
        """The span of a table of shape (n, columns)."""
        check_varies(name, values)
        return cls(low=values.min(axis=0), high=values.max(axis=0))

    def inwards(self, values: Floats) -> Floats:
        """To the network's scale."""
        return np.asarray(2.0 * (values - self.low) / (self.high - self.low) - 1.0)

    def outwards(self, values: Floats) -> Floats:
        """Back to physical units."""
        return np.asarray(self.low + (values + 1.0) * (self.high - self.low) / 2.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Network(ContentValue):
    """A trained network from outputs of a press to an inclusion, both in physical units.

    Attributes
    ----------
    layers
        The layers.
    weights
        Weights and biases, shape (layers.weights,), for inputs and outputs scaled to [-1, 1].
    input_span, output_span
        Ranges of the scaling to [-1, 1].
    """

    layers: Layers
    weights: Floats
    input_span: Span
    output_span: Span

    def __call__(self, inputs: ArrayLike) -> Floats:
        """Estimates of shape (n, outputs) from ``inputs`` of shape (n, inputs).

        Raises
        ------
        InputError
            When the inputs are not finite or their shape does not fit.
        """
        table = require_array("inputs", inputs, ndim=2)
        if table.shape[1] != self.layers.inputs:
            raise InputError(f"inputs must have {self.layers.inputs} columns; got {table.shape[1]}")
        return self.output_span.outwards(activations(self.layers, self.weights, self.input_span.inwards(table))[-1])
