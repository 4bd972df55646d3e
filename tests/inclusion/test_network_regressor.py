"""The networks within scikit-learn: its checks of estimators, and the predictions of `train_network`."""

from __future__ import annotations

import pickle
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from sklearn.model_selection import cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.estimator_checks import parametrize_with_checks

from tsis.inclusion.network_regressor import NetworkRegressor
from tsis.inclusion.network_training import train_network

if TYPE_CHECKING:
    from collections.abc import Callable

EXPLAINED = {
    "check_array_api_input": "scikit-learn skips it unless SCIPY_ARRAY_API is set; the networks take NumPy arrays",
}


@parametrize_with_checks(  # type: ignore[untyped-decorator]
    [NetworkRegressor(hidden=(4,), networks=2, validation_fraction=0.1, random_state=0)],
    expected_failed_checks=lambda _: EXPLAINED,
    xfail_strict=False,
)
def test_scikit_learn_accepts_it(estimator: NetworkRegressor, check: Callable[[NetworkRegressor], None]) -> None:
    check(estimator)


def samples() -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    x = np.random.default_rng(2).uniform(-1.0, 1.0, size=(80, 2))
    return x, np.column_stack([x[:, 0] ** 2, x[:, 0] * x[:, 1]])


def test_its_predictions_are_those_of_the_network() -> None:
    x, y = samples()
    regressor = NetworkRegressor(method="lm", random_state=3).fit(x, y)
    rng = np.random.default_rng(np.random.RandomState(3).randint(2**31 - 1))
    order = rng.permutation(len(x))
    network, _ = train_network(x[order], y[order], rng=rng, method="lm")
    np.testing.assert_allclose(regressor.predict(x), network(x), rtol=1e-9)
    np.testing.assert_allclose(regressor.predict(x), y, atol=0.02)
    assert regressor.score(x, y) > 0.999


def test_the_mean_of_several_networks_and_one_output() -> None:
    x, y = samples()
    regressor = NetworkRegressor(method="lm", networks=3, validation_fraction=0.1, random_state=1).fit(x, y[:, 0])
    assert len(regressor.networks_) == 3
    single = [network(x)[:, 0] for network in regressor.networks_]
    np.testing.assert_allclose(regressor.predict(x), np.mean(single, axis=0))
    assert regressor.predict(x).shape == (80,)
    again = pickle.loads(pickle.dumps(regressor))
    np.testing.assert_array_equal(again.predict(x), regressor.predict(x))


def test_it_serves_pipelines_and_cross_validation() -> None:
    x, y = samples()
    scores = cross_val_score(make_pipeline(StandardScaler(), NetworkRegressor(method="lm", random_state=0)), x, y, cv=3)
    assert scores.min() > 0.9


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"method": "adam"}, "no training method is called 'adam'"),
        ({"networks": 0}, "networks must lie"),
        ({"validation_fraction": 0.95}, "validation_fraction must lie"),
        ({"hidden": 4}, "hidden must be a sequence"),
    ],
)
def test_settings_out_of_range_are_refused(settings: dict[str, Any], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        NetworkRegressor(**settings).fit(*samples())
