"""What is reckoned on top of the network route: correlations with others held, and data normalised by phantom."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import rankdata, spearmanr
from studies.figures_6_18_to_6_22 import held_correlation, normalised


def test_correlation_with_others_held_is_that_of_what_regressions_leave() -> None:
    rng = np.random.default_rng(4)
    inclusions = rng.normal(size=(200, 3))
    inclusions[:, 1] += inclusions[:, 0]
    values = 2.0 * inclusions[:, 0] - inclusions[:, 2] + rng.normal(size=200)
    ranks = rankdata(inclusions, axis=0)
    for of in range(3):
        others = np.column_stack([np.ones(200), np.delete(ranks, of, axis=1)])
        left = [
            each - others @ np.linalg.lstsq(others, each, rcond=None)[0] for each in (rankdata(values), ranks[:, of])
        ]
        assert held_correlation(values, inclusions, of) == pytest.approx(np.corrcoef(left)[0, 1], abs=1e-9)


def test_a_parameter_that_does_not_enter_correlates_only_through_the_others() -> None:
    rng = np.random.default_rng(5)
    inclusions = rng.normal(size=(2000, 2))
    inclusions[:, 1] += inclusions[:, 0]
    values = inclusions[:, 0] + 0.1 * rng.normal(size=2000)
    assert spearmanr(values, inclusions[:, 1]).statistic > 0.6
    assert abs(held_correlation(values, inclusions, 1)) < 0.1


def test_each_phantom_is_scaled_by_the_greatest_of_its_inclusions() -> None:
    outputs = np.arange(1.0, 28.0).reshape(9, 3)
    scaled = normalised(outputs)
    assert np.isclose(scaled, 1.0).sum(axis=0).tolist() == [3, 3, 3]
    np.testing.assert_allclose(scaled[3:6] * outputs[5], outputs[3:6])
