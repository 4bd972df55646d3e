"""Linear maps from measured to simulated outputs (section 6.3.2), and repeated trainings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import InputError
from tsis.inclusion.network._network import check_varies
from tsis.inclusion.network._training import MOST_VALUES, PATIENCE, train_repeatedly
from tsis.model import require_array, require_number

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import ArrayLike

    from tsis.inclusion._prior import Floats


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinearMapping:
    """Straight lines from measured to simulated outputs, one per column.

    Attributes
    ----------
    slope, intercept
        Of each output, shape (outputs,).
    r_squared
        Fraction of the simulated outputs' variance explained by the lines, shape (outputs,).
    """

    slope: Floats
    intercept: Floats
    r_squared: Floats

    def __call__(self, measured: ArrayLike) -> Floats:
        """Simulated outputs for measured ones, shape (n, outputs)."""
        return np.asarray(self.intercept + self.slope * require_array("measured", measured, ndim=2))


def fit_mapping(measured: ArrayLike, simulated: ArrayLike) -> LinearMapping:
    """Fit lines through known inclusions by least squares.

    Parameters
    ----------
    measured, simulated
        Outputs of the same inclusions from frames and from the simulation, shapes (n, outputs), n at least 2.

    Raises
    ------
    InputError
        When the tables do not fit together, or an output is the same for all inclusions.

    Examples
    --------
    >>> mapping = fit_mapping([[1.0], [2.0], [4.0]], [[5.0], [7.0], [11.0]])
    >>> mapping([[3.0]]).round(6).tolist(), mapping.r_squared.round(6).tolist()
    ([[9.0]], [1.0])
    """
    x, y = require_array("measured", measured, ndim=2), require_array("simulated", simulated, ndim=2)
    if x.shape != y.shape or len(x) < 2:
        raise InputError(f"measured and simulated must have one shape, two rows or more; got {x.shape} and {y.shape}")
    check_varies("measured", x)
    check_varies("simulated", y)
    from_mean, requested = x - x.mean(axis=0), y - y.mean(axis=0)
    slope = (from_mean * requested).sum(axis=0) / (from_mean**2).sum(axis=0)
    left = ((requested - slope * from_mean) ** 2).sum(axis=0)
    return LinearMapping(
        slope=slope,
        intercept=y.mean(axis=0) - slope * x.mean(axis=0),
        r_squared=1.0 - left / (requested**2).sum(axis=0),
    )


def leave_one_out_mapping(measured: ArrayLike, simulated: ArrayLike) -> Floats:
    """Measured outputs mapped by lines fitted to the other inclusions; shape (n, outputs).

    Parameters
    ----------
    measured, simulated
        Outputs of n >= 3 inclusions by frames and by the model, shape (n, outputs), in the same units.

    Raises
    ------
    InputError
        When the shapes differ, or there are fewer than three inclusions.
    """
    x, y = require_array("measured", measured, ndim=2), require_array("simulated", simulated, ndim=2)
    if x.shape != y.shape or len(x) < 3:
        raise InputError(f"measured and simulated must have one shape, three rows or more; got {x.shape}, {y.shape}")
    others = ~np.eye(len(x), dtype=bool)
    return np.concatenate([fit_mapping(x[save], y[save])(x[~save]) for save in others])


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
    given, requested = require_array("inputs", inputs, ndim=2), require_array("targets", targets, ndim=2)
    if len(given) != len(requested):
        raise InputError(f"inputs and targets must have as many rows; got {len(given)} and {len(requested)}")
    trials = int(require_number("trials", trials, 1, 100_000))
    validated = int(require_number("validated", validated, 1, max(1, len(given) - 2), hint="two samples must be left"))
    rows = require_array("unknown", unknown, ndim=2)
    if trials * len(rows) * requested.shape[1] > MOST_VALUES:
        raise InputError(
            f"trials times rows of unknown times outputs must be at most {MOST_VALUES:g}; "
            f"got {trials} x {len(rows)} x {requested.shape[1]} (give fewer at a time)"
        )
    networks = train_repeatedly(
        given,
        requested,
        rng=rng,
        networks=trials,
        validated=validated,
        hidden=hidden,
        method=method,
        patience=patience,
        progress=progress,
    )
    return np.array([network(rows) for network in networks])
