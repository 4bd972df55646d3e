"""Training the network: scaled conjugate gradients, as in the source, or Levenberg-Marquardt, as in its outlook.

Both minimise the mean square error over the training samples, with inputs and outputs scaled to [-1, 1], and stop when
the error over the validation samples has not fallen for some steps; the weights kept are those where it was least.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import least_squares

from tsis.inclusion.network import Layers, Network, Span, activations, jacobian, mean_square
from tsis.inclusion.network_descent import scaled_conjugate_gradient
from tsis.model.check import require_array, require_number, require_one_of, require_type
from tsis.model.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

MOST_VALUES = 50_000_000  # of an array: 400 MB


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkTraining:
    """How a training went.

    Attributes
    ----------
    method
        ``"scg"`` or ``"lm"``.
    steps
        Steps down that were taken.
    error, validation_error
        Mean square errors of the weights kept, on the scale of [-1, 1]; the second is None without validation samples.
    reason
        ``"validation"`` when the validation error no longer fell, ``"converged"``, or ``"iterations"``.
    """

    method: str
    steps: int
    error: float
    validation_error: float | None
    reason: str


class _Enough(Exception):  # noqa: N818 - no error: the way out of a minimiser that has no other
    """The watch or the number of steps says stop."""


@dataclass(slots=True, kw_only=True)
class _Watch:
    """Keeps the weights of least error over the validation samples, and says when to stop waiting for better ones."""

    error: Callable[[NDArray[np.float64]], float] | None
    patience: int
    best: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    least: float = np.inf
    worse: int = 0
    steps: int = 0

    def __call__(self, weights: NDArray[np.float64]) -> bool:
        """Take note of the weights after a step; True when there is no more to wait for."""
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
    patience: int = 6,
) -> tuple[Network, NetworkTraining]:
    """Train a network on samples; section 6.3.3.

    Parameters
    ----------
    inputs, targets
        Samples in physical units, shapes (n, inputs) and (n, outputs), n at least 2.
    rng
        Draws the weights to start from.
    validation
        Inputs and targets of samples that stop the training and change no weight; None trains to the end.
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
        The network, and how its training went.

    Raises
    ------
    InputError
        When tables are not finite, do not fit together or do not vary, or there are too few samples for the method.
    UnknownNameError
        When no method has that name.

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


def _samples(first: str, given: ArrayLike, second: str, wanted: ArrayLike) -> tuple[NDArray[np.float64], ...]:
    """Two tables with one row a sample each."""
    tables = require_array(first, given, ndim=2), require_array(second, wanted, ndim=2)
    if len(tables[0]) != len(tables[1]):
        raise InputError(f"{first} and {second} must have as many rows; got {len(tables[0])} and {len(tables[1])}")
    return tables


def _check_size(layers: Layers, targets: NDArray[np.float64], method: str) -> None:
    """Refuse what Levenberg-Marquardt cannot determine, and what would not fit into memory."""
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
) -> Callable[[NDArray[np.float64]], float] | None:
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
    layers: Layers,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    start: NDArray[np.float64],
    iterations: int,
    watch: _Watch,
) -> bool:
    """Descend; True when the iterations ran out."""
    found = scaled_conjugate_gradient(
        lambda weights: mean_square(layers, weights, x, y), start, iterations=iterations, stop=watch
    )
    return found.reason == "iterations"


def _by_levenberg_marquardt(
    layers: Layers,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    start: NDArray[np.float64],
    iterations: int,
    watch: _Watch,
) -> bool:
    """Descend; True when the iterations ran out."""
    taken = itertools.count()

    def residual(weights: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray((activations(layers, weights, x)[-1] - y).ravel())

    def slopes(weights: NDArray[np.float64]) -> NDArray[np.float64]:
        # MINPACK asks for slopes at the start and after each step that it took, and nowhere else.
        step = next(taken)
        if step > 0 and (watch(weights) or step >= iterations):
            raise _Enough
        return jacobian(layers, weights, x).reshape(y.size, layers.weights)

    try:
        found = least_squares(residual, start, jac=slopes, method="lm")
    except _Enough:
        return not watch.tired
    watch(found.x)
    return not found.success


MINIMISERS = {"scg": _by_conjugate_gradients, "lm": _by_levenberg_marquardt}
