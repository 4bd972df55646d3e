"""Do the intervals hold, over 200 virtual presses that the estimator knows nothing about?"""

from __future__ import annotations

import pytest
from benchmarks.coverage import run

from tsis.inclusion import PARAMETERS


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_ninety_percent_intervals_hold_the_truth() -> None:
    outcome = run(200, seed=1)
    assert outcome.truth.shape == (200, 3)
    for name, coverage in zip(PARAMETERS, outcome.coverage, strict=True):
        assert 0.85 <= coverage <= 0.95, f"{name}: {coverage:.3f}"
    assert (outcome.narrowing[:, :2].mean(axis=0) < 0.3).all(), "intervals that say something"
