from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

from tsis.calibration.measured import MeasuredValue
from tsis.errors import InputError


def test_interval_of_a_known_spread_is_gaussian() -> None:
    low, high = MeasuredValue(value=3.0, sd=2.0).interval(0.95)
    assert (low, high) == pytest.approx((3 - 2 * norm.ppf(0.975), 3 + 2 * norm.ppf(0.975)))


def test_interval_of_a_mean_of_five_holds_the_truth_as_often_as_it_says() -> None:
    samples = np.random.default_rng(1).standard_normal((4000, 5))
    means, spreads = samples.mean(axis=1), samples.std(axis=1, ddof=1) / np.sqrt(5)
    held = 0
    for mean, spread in zip(means, spreads, strict=True):
        low, high = MeasuredValue(value=float(mean), sd=float(spread), degrees_of_freedom=4).interval(0.9)
        held += low < 0 < high
    assert held / 4000 == pytest.approx(0.9, abs=0.015)


@pytest.mark.parametrize(
    "wrong", [{"value": math.nan}, {"sd": -1.0}, {"sd": math.inf}, {"degrees_of_freedom": 0.5}, {"unit": 3}]
)
def test_numbers_out_of_range_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=next(iter(wrong))):
        MeasuredValue(**{"value": 1.0, "sd": 1.0, **wrong})
