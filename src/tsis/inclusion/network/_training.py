"""Training of networks by scaled conjugate gradients (Møller) or Levenberg-Marquardt.

M. F. Møller, A scaled conjugate gradient algorithm for fast supervised learning, Neural Networks 6 (1993) 525-533. The
numbers in the comments are the steps of his algorithm.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.errors import InputError
from tsis.inclusion.network._network import Layers, Network, Span, activations, jacobian, mean_square
from tsis.model import require_array, require_number, require_one_of, require_type

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import ArrayLike

    from tsis.inclusion._prior import Floats


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
    """Stop requested by the validation or the number of steps."""


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
    given, requested = _samples("inputs", inputs, "targets", targets)
    if not isinstance(hidden, Sequence):
        raise InputError(f"hidden must be a sequence of layer sizes, like (10,); got {hidden!r}")
    layers = Layers(inputs=given.shape[1], hidden=tuple(hidden), outputs=requested.shape[1])
    _check_size(layers, requested, method)
    input_span, output_span = Span.of("inputs", given), Span.of("targets", requested)
    x, y = input_span.inwards(given), output_span.inwards(requested)
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


def _samples(first: str, given: ArrayLike, second: str, requested: ArrayLike) -> tuple[Floats, ...]:
    """Two tables of equally many rows."""
    tables = require_array(first, given, ndim=2), require_array(second, requested, ndim=2)
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
    given, requested = _samples("validation inputs", validation[0], "validation targets", validation[1])
    if (given.shape[1], requested.shape[1]) != (layers.inputs, layers.outputs):
        raise InputError(
            f"validation must have {layers.inputs} columns and {layers.outputs}; "
            f"got {given.shape[1]} and {requested.shape[1]}"
        )
    x, y = input_span.inwards(given), output_span.inwards(requested)
    return lambda weights: float(np.mean((activations(layers, weights, x)[-1] - y) ** 2))


def _by_conjugate_gradients(
    layers: Layers, x: Floats, y: Floats, start: Floats, iterations: int, watch: _Watch
) -> bool:
    """Descend; True when the iterations ran out."""
    result = scaled_conjugate_gradient(
        lambda weights: mean_square(layers, weights, x, y), start, iterations=iterations, stop=watch
    )
    return result.reason == "iterations"


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
        result = scipy.optimize.least_squares(residual, start, jac=slopes, method="lm")
    except _Enough:
        return not watch.tired
    watch(result.x)
    return not result.success


MINIMISERS = {"scg": _by_conjugate_gradients, "lm": _by_levenberg_marquardt}
