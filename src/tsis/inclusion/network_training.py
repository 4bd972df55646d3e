"""A network of sigmoid units with linear output, its derivatives and training.

The dissertation's network has three inputs, ten sigmoid units and three linear units (section 6.3.3). It names a layer
between them without its size; ``hidden`` may include one. Training is by scaled conjugate gradients (M. F. Møller, A
scaled conjugate gradient algorithm for fast supervised learning, Neural Networks 6 (1993) 525-533; the numbers in the
comments are the steps of his algorithm) or by Levenberg-Marquardt. Both are the source's; libraries of networks have
neither.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.errors import InputError
from tsis.model.content import ContentValue
from tsis.model.require import require_array, require_number, require_one_of, require_type

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import ArrayLike

    from tsis.inclusion.prior import Floats


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
        matrices, start = [], 0
        for below, above in pairwise(self.sizes):
            size = (below + 1) * above
            matrices.append(weights[start : start + size].reshape(above, below + 1))
            start += size
        return matrices

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
    values = activations(layers, weights, inputs)
    residual = values[-1] - targets
    error = (2.0 / residual.size) * residual[:, None, :]
    gradient = [
        np.append(change[:, 0].T @ below, change[:, 0].sum(axis=0)[:, None], axis=1).ravel()
        for change, below in _backwards(layers, weights, values, error)
    ]
    return float(np.mean(residual**2)), np.concatenate(gradient[::-1])


def jacobian(layers: Layers, weights: Floats, inputs: Floats) -> Floats:
    """Derivatives of the outputs by the weights, shape (n, outputs, weights)."""
    values = activations(layers, weights, inputs)
    every = np.broadcast_to(np.eye(layers.outputs), (len(inputs), layers.outputs, layers.outputs))
    parts = []
    for change, below in _backwards(layers, weights, values, every):
        with_bias = np.append(below, np.ones((len(below), 1)), axis=1)
        parts.append((change[..., None] * with_bias[:, None, None, :]).reshape(*change.shape[:2], -1))
    return np.concatenate(parts[::-1], axis=-1)


def _backwards(
    layers: Layers, weights: Floats, values: list[Floats], at_outputs: Floats
) -> Iterator[tuple[Floats, Floats]]:
    """Backpropagate: from the last layer, derivatives by its units' sums, (n, k, units), and its inputs.

    ``at_outputs``, shape (n, k, outputs), is k directions in the outputs of each sample.
    """
    change = at_outputs
    for matrix, below in zip(reversed(layers.matrices(weights)), reversed(values[:-1]), strict=True):
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


FIRST_STEP, FIRST_DAMPING = 5e-5, 5e-7  # sigma and lambda_1; Møller asks for at most 1e-4 and 1e-6
GREATEST_DAMPING = 1e20  # beyond it no step changes a double any more


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Descent:
    """Result of a minimisation."""

    x: Floats  # the point, shape (n,)
    value: float  # the value there
    iterations: int  # number of steps, each of one or two gradients
    # ``"gradient"`` when it vanished, ``"stopped"`` by the caller, ``"damping"`` when rounding prevents a descent,
    # ``"iterations"`` at their limit
    reason: str


def scaled_conjugate_gradient(
    value_and_gradient: Callable[[Floats], tuple[float, Floats]],
    start: Floats,
    *,
    iterations: int = 1000,
    least_gradient: float = 1e-6,
    stop: Callable[[Floats], bool] | None = None,
) -> Descent:
    """Minimise a smooth function, given with its gradient, from ``start``, shape (n,).

    It ends after ``iterations`` steps, successful or not, at a gradient of norm ``least_gradient``, or when ``stop`` is
    true of a new point.

    Examples
    --------
    >>> found = scaled_conjugate_gradient(lambda x: (float(x @ x), 2 * x), np.array([3.0, -4.0]))
    >>> found.reason, bool(np.abs(found.x).max() < 1e-6)
    ('gradient', True)
    """
    x = np.array(start, dtype=np.float64)
    value, gradient = value_and_gradient(x)
    residual = -gradient
    direction = residual
    damping, raised = FIRST_DAMPING, 0.0
    success, curvature = True, 0.0
    for step in range(1, iterations + 1):
        norm2 = float(direction @ direction)
        if np.sqrt(residual @ residual) <= least_gradient or norm2 == 0.0:
            return Descent(x=x, value=value, iterations=step - 1, reason="gradient")
        if damping > GREATEST_DAMPING:
            return Descent(x=x, value=value, iterations=step - 1, reason="damping")
        if success:  # 2: curvature along the direction, by a difference of gradients
            short = FIRST_STEP / np.sqrt(norm2)
            curvature = float(direction @ (value_and_gradient(x + short * direction)[1] + residual)) / short
        curvature += (damping - raised) * norm2  # 3
        if curvature <= 0.0:  # 4: make it positive
            raised = 2.0 * (damping - curvature / norm2)
            curvature = damping * norm2 - curvature
            damping = raised
        slope = float(direction @ residual)  # 5
        trial = x + slope / curvature * direction
        trial_value, trial_gradient = value_and_gradient(trial)
        agreement = 2.0 * curvature * (value - trial_value) / slope**2  # 6: of the parabola with the function
        success = bool(agreement >= 0.0)
        if success:  # 7
            x, value, raised = trial, trial_value, 0.0
            if stop is not None and stop(x):
                return Descent(x=x, value=value, iterations=step, reason="stopped")
            before, residual = residual, -trial_gradient
            turn = 0.0 if step % x.size == 0 else float(residual @ (residual - before)) / slope
            direction = residual + turn * direction
            if agreement >= 0.75:
                damping /= 4.0
        else:
            raised = damping
        if not agreement >= 0.25:  # 8; a value that is no number counts as a failure
            damping += curvature * (1.0 - agreement) / norm2 if np.isfinite(agreement) else 3.0 * damping
    return Descent(x=x, value=value, iterations=iterations, reason="iterations")


MOST_VALUES = 50_000_000  # of an array: 400 MB
PATIENCE = 6  # steps without a smaller validation error


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkTraining:
    """Record of a training.

    Attributes
    ----------
    method
        ``"scg"`` or ``"lm"``.
    steps
        Number of descent steps.
    error, validation_error
        Mean square errors of the final weights, on the scale of [-1, 1]; the second is None without validation.
    reason
        ``"validation"`` when the validation error no longer fell, ``"converged"``, or ``"iterations"``.
    """

    method: str
    steps: int
    error: float
    validation_error: float | None
    reason: str


class _Enough(Exception):  # noqa: N818 - no error: the way out of a minimiser that has no other
    """Stop asked for by the validation or the number of steps."""


@dataclass(slots=True, kw_only=True)
class _Watch:
    """Early stopping: the weights of least validation error, and the decision to stop."""

    error: Callable[[Floats], float] | None
    patience: int
    best: Floats = field(default_factory=lambda: np.empty(0))
    least: float = np.inf
    worse: int = 0
    steps: int = 0

    def __call__(self, weights: Floats) -> bool:
        """Record the weights after a step; True to stop."""
        self.steps += 1
        error = np.inf if self.error is None else self.error(weights)
        if self.error is None or error < self.least:
            self.best, self.least, self.worse = weights.copy(), error, 0
        else:
            self.worse += 1
        return self.tired

    @property
    def tired(self) -> bool:
        """Whether the validation error has not fallen for too long."""
        return self.worse >= self.patience


def train_network(
    inputs: ArrayLike,
    targets: ArrayLike,
    *,
    rng: np.random.Generator,
    validation: tuple[ArrayLike, ArrayLike] | None = None,
    hidden: Sequence[int] = (10,),
    method: str = "scg",
    iterations: int = 1000,
    patience: int = PATIENCE,
) -> tuple[Network, NetworkTraining]:
    """Train a network on samples; section 6.3.3.

    Parameters
    ----------
    inputs, targets
        Samples in physical units, shapes (n, inputs) and (n, outputs), n at least 2.
    rng
        Draws the initial weights.
    validation
        Inputs and targets of the samples of early stopping; None trains to the end.
    hidden
        Sigmoid units of each layer below the linear one, in [1, 1000].
    method
        ``"scg"``: scaled conjugate gradients (Møller 1993). ``"lm"``: Levenberg-Marquardt as in MINPACK, which needs at
        least as many values in ``targets`` as there are weights.
    iterations
        Steps at most, in [1, 1e6].
    patience
        Steps without a smaller validation error after which training stops, in [1, 1e6].

    Returns
    -------
    Network, Training
        The network and the record of its training.

    Raises
    ------
    InputError
        When tables are not finite, do not fit together or do not vary, or there are too few samples for the method.
    UnknownNameError
        When the method is unknown.

    Examples
    --------
    >>> x = np.linspace(-1.0, 1.0, 40)[:, None]
    >>> network, training = train_network(x, x**2, rng=np.random.default_rng(0), method="lm")
    >>> bool(np.abs(network(x) - x**2).max() < 0.01)
    True
    """
    require_type("rng", rng, np.random.Generator)
    require_one_of("training method", method, MINIMISERS)
    iterations = int(require_number("iterations", iterations, 1, 1_000_000))
    patience = int(require_number("patience", patience, 1, 1_000_000))
    given, wanted = _samples("inputs", inputs, "targets", targets)
    if not isinstance(hidden, Sequence):
        raise InputError(f"hidden must be a sequence of layer sizes, like (10,); got {hidden!r}")
    layers = Layers(inputs=given.shape[1], hidden=tuple(hidden), outputs=wanted.shape[1])
    _check_size(layers, wanted, method)
    input_span, output_span = Span.of("inputs", given), Span.of("targets", wanted)
    x, y = input_span.inwards(given), output_span.inwards(wanted)
    watch = _Watch(error=_validation_error(layers, validation, input_span, output_span), patience=patience)
    start = layers.random_weights(rng)
    watch(start)
    ran_out = MINIMISERS[method](layers, x, y, start, iterations, watch)
    network = Network(layers=layers, weights=watch.best, input_span=input_span, output_span=output_span)
    return network, NetworkTraining(
        method=method,
        steps=watch.steps - 1,
        error=mean_square(layers, watch.best, x, y)[0],
        validation_error=None if watch.error is None else watch.least,
        reason="validation" if watch.tired else "iterations" if ran_out else "converged",
    )


def train_repeatedly(
    inputs: Floats,
    targets: Floats,
    *,
    rng: np.random.Generator,
    networks: int,
    validated: int,
    hidden: Sequence[int],
    method: str,
    patience: int = PATIENCE,
    progress: Callable[[int, int], None] | None = None,
) -> Iterator[Network]:
    """Networks with different initial weights and ``validated`` different validation samples, 0 for none."""
    for number in range(networks):
        order = rng.permutation(len(inputs))
        stopping, training = order[:validated], order[validated:]
        network, _ = train_network(
            inputs[training],
            targets[training],
            rng=rng,
            validation=(inputs[stopping], targets[stopping]) if validated else None,
            hidden=hidden,
            method=method,
            patience=patience,
        )
        if progress is not None:
            progress(number + 1, networks)
        yield network


def _samples(first: str, given: ArrayLike, second: str, wanted: ArrayLike) -> tuple[Floats, ...]:
    """Two tables of equally many rows."""
    tables = require_array(first, given, ndim=2), require_array(second, wanted, ndim=2)
    if len(tables[0]) != len(tables[1]):
        raise InputError(f"{first} and {second} must have as many rows; got {len(tables[0])} and {len(tables[1])}")
    return tables


def _check_size(layers: Layers, targets: Floats, method: str) -> None:
    """Refuse underdetermined problems and too large Jacobians."""
    if method != "lm":
        return
    if targets.size < layers.weights:
        raise InputError(
            f"targets must hold at least {layers.weights} values, one a weight, for Levenberg-Marquardt; "
            f"got {targets.size} (give more samples or fewer hidden units)"
        )
    if targets.size * layers.weights > MOST_VALUES:
        raise InputError(
            f"the Jacobian must hold at most {MOST_VALUES:g} values; got {targets.size * layers.weights:g} "
            "(give fewer samples or hidden units, or take method 'scg')"
        )


def _validation_error(
    layers: Layers, validation: tuple[ArrayLike, ArrayLike] | None, input_span: Span, output_span: Span
) -> Callable[[Floats], float] | None:
    """Mean square error over the validation samples as a function of the weights; None without such samples."""
    if validation is None:
        return None
    if not (isinstance(validation, tuple) and len(validation) == 2):
        raise InputError(f"validation must be a pair (inputs, targets); got {validation!r:.80}")
    given, wanted = _samples("validation inputs", validation[0], "validation targets", validation[1])
    if (given.shape[1], wanted.shape[1]) != (layers.inputs, layers.outputs):
        raise InputError(
            f"validation must have {layers.inputs} columns and {layers.outputs}; "
            f"got {given.shape[1]} and {wanted.shape[1]}"
        )
    x, y = input_span.inwards(given), output_span.inwards(wanted)
    return lambda weights: float(np.mean((activations(layers, weights, x)[-1] - y) ** 2))


def _by_conjugate_gradients(
    layers: Layers, x: Floats, y: Floats, start: Floats, iterations: int, watch: _Watch
) -> bool:
    """Descend; True when the iterations ran out."""
    descent = scaled_conjugate_gradient(
        lambda weights: mean_square(layers, weights, x, y), start, iterations=iterations, stop=watch
    )
    return descent.reason == "iterations"


def _by_levenberg_marquardt(
    layers: Layers, x: Floats, y: Floats, start: Floats, iterations: int, watch: _Watch
) -> bool:
    """Descend; True when the iterations ran out."""
    taken = itertools.count()

    def residual(weights: Floats) -> Floats:
        return np.asarray((activations(layers, weights, x)[-1] - y).ravel())

    def slopes(weights: Floats) -> Floats:
        # MINPACK evaluates the Jacobian at the start and after each accepted step only.
        step = next(taken)
        if step > 0 and (watch(weights) or step >= iterations):
            raise _Enough
        return jacobian(layers, weights, x).reshape(y.size, layers.weights)

    try:
        minimum = scipy.optimize.least_squares(residual, start, jac=slopes, method="lm")
    except _Enough:
        return not watch.tired
    watch(minimum.x)
    return not minimum.success


MINIMISERS = {"scg": _by_conjugate_gradients, "lm": _by_levenberg_marquardt}


TRIALS = 100
VALIDATED = 9  # of the 134 samples, as in the source


def estimate_by_networks(
    inputs: ArrayLike,
    targets: ArrayLike,
    unknown: ArrayLike,
    *,
    rng: np.random.Generator,
    trials: int = TRIALS,
    validated: int = VALIDATED,
    hidden: Sequence[int] = (10,),
    method: str = "scg",
    patience: int = PATIENCE,
    progress: Callable[[int, int], None] | None = None,
) -> Floats:
    """Estimates by networks with different initial weights and validation samples.

    Parameters
    ----------
    inputs, targets
        Simulated outputs and their inclusions, shapes (n, inputs) and (n, outputs).
    unknown
        Outputs to estimate from, shape (m, inputs).
    rng
        Draws weights and splits.
    trials
        Number of networks, in [1, 1e5].
    validated
        Validation samples of each split, in [1, n - 2].
    hidden, method, patience
        See `train_network`.
    progress
        Called with (networks trained, all networks).

    Returns
    -------
    Shape (trials, m, outputs).

    Raises
    ------
    InputError
        When tables are not finite, do not fit together or do not vary.
    """
    given, wanted = require_array("inputs", inputs, ndim=2), require_array("targets", targets, ndim=2)
    if len(given) != len(wanted):
        raise InputError(f"inputs and targets must have as many rows; got {len(given)} and {len(wanted)}")
    trials = int(require_number("trials", trials, 1, 100_000))
    validated = int(require_number("validated", validated, 1, max(1, len(given) - 2), hint="two samples must be left"))
    rows = require_array("unknown", unknown, ndim=2)
    if trials * len(rows) * wanted.shape[1] > MOST_VALUES:
        raise InputError(
            f"trials times rows of unknown times outputs must be at most {MOST_VALUES:g}; "
            f"got {trials} x {len(rows)} x {wanted.shape[1]} (give fewer at a time)"
        )
    networks = train_repeatedly(
        given,
        wanted,
        rng=rng,
        networks=trials,
        validated=validated,
        hidden=hidden,
        method=method,
        patience=patience,
        progress=progress,
    )
    return np.array([network(rows) for network in networks])
