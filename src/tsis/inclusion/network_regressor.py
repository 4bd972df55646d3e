"""The networks as an estimator of scikit-learn."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Self

import numpy as np

from tsis.errors import import_extra
from tsis.inclusion.network_training import PATIENCE, train_repeatedly
from tsis.model.require import require_integer, require_number

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray


import_extra("sklearn", feature="a network for scikit-learn", extra="study")

from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.utils import check_random_state
from sklearn.utils.validation import check_is_fitted, validate_data

LARGEST_VALIDATED = 0.9


class NetworkRegressor(RegressorMixin, BaseEstimator):  # type: ignore[misc]
    """`tsis.inclusion.network_training.train_network` as an estimator of scikit-learn, for any features and targets.

    The prediction is the mean of several networks, which differ in their initial weights and validation samples. It
    needs the extra ``study``.

    Parameters
    ----------
    hidden, method, patience
        As for `train_network`.
    networks
        Number of networks, in [1, 1000].
    validation_fraction
        Fraction of the samples for early stopping, in [0, 0.9]; 0 trains to the end.
    random_state
        Seed of initial weights and validation samples: None, a whole number or a ``numpy.random.RandomState``.

    Attributes
    ----------
    networks_
        The trained networks.
    n_features_in_
        Number of features.

    Examples
    --------
    >>> x = np.linspace(-1.0, 1.0, 40)[:, None]
    >>> regressor = NetworkRegressor(method="lm", validation_fraction=0.0, random_state=0).fit(x, x[:, 0] ** 2)
    >>> bool(np.abs(regressor.predict(x) - x[:, 0] ** 2).max() < 0.01)
    True
    """

    def __init__(
        self,
        hidden: Sequence[int] = (10,),
        method: str = "scg",
        patience: int = PATIENCE,
        networks: int = 1,
        validation_fraction: float = 0.0,
        random_state: int | np.random.RandomState | None = None,
    ) -> None:
        self.hidden = hidden
        self.method = method
        self.patience = patience
        self.networks = networks
        self.validation_fraction = validation_fraction
        self.random_state = random_state

    def fit(self, X: ArrayLike, y: ArrayLike) -> Self:
        """Train on features of shape (n, features) and targets of shape (n,) or (n, outputs), each of which varies.

        Raises
        ------
        ValueError
            When a setting is out of range, the arrays do not fit together, or there are too few samples.
        """
        fraction = require_number("validation_fraction", self.validation_fraction, 0.0, LARGEST_VALIDATED)
        networks = require_integer("networks", self.networks, 1, 1000)
        inputs, targets = validate_data(self, X, y, multi_output=True, y_numeric=True, ensure_min_samples=2)
        self._single = targets.ndim == 1
        seed = check_random_state(self.random_state).randint(2**31 - 1)
        self.networks_ = list(
            train_repeatedly(
                inputs.astype(float),
                targets.reshape(len(targets), -1).astype(float),
                rng=np.random.default_rng(seed),
                networks=networks,
                validated=round(fraction * len(inputs)),
                hidden=self.hidden,
                method=self.method,
                patience=self.patience,
            )
        )
        return self

    def predict(self, X: ArrayLike) -> NDArray[np.float64]:
        """Mean of the networks, shape (n,) or (n, outputs) as the targets of the training."""
        check_is_fitted(self)
        inputs = validate_data(self, X, reset=False).astype(float)
        mean: NDArray[np.float64] = np.mean([network(inputs) for network in self.networks_], axis=0)
        return mean[:, 0] if self._single else mean

    def __sklearn_tags__(self) -> Any:
        """Several targets are possible."""
        tags = super().__sklearn_tags__()
        tags.target_tags.single_output = True
        tags.target_tags.multi_output = True
        return tags
