"""Many networks on the same simulations, each from other weights and another split: section 6.3.4's trials."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.inclusion.network_training import MOST_VALUES, train_network
from tsis.model.check import require_array, require_number
from tsis.model.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import ArrayLike, NDArray

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
    patience: int = 6,
    progress: Callable[[int, int], None] | None = None,
) -> NDArray[np.float64]:
    """Estimates by networks that differ in their first weights and in which samples stop their training.

    Parameters
    ----------
    inputs, targets
        Simulated outputs and the inclusions behind them, shapes (n, inputs) and (n, outputs).
    unknown
        Outputs to estimate from, shape (m, inputs).
    rng
        Draws weights and splits.
    trials
        How many networks, in [1, 1e5].
    validated
        Samples of each split that stop the training and change no weight, in [1, n - 2].
    hidden, method, patience
        See `train_network`.
    progress
        Called with (networks trained, networks in all) as the work goes on.

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
    found = []
    for trial in range(trials):
        order = rng.permutation(len(given))
        held, trained = order[:validated], order[validated:]
        network, _ = train_network(
            given[trained],
            wanted[trained],
            rng=rng,
            validation=(given[held], wanted[held]),
            hidden=hidden,
            method=method,
            patience=patience,
        )
        found.append(network(rows))
        if progress is not None:
            progress(trial + 1, trials)
    return np.array(found)
