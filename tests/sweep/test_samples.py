"""Samples are those that SciPy draws, whatever the size of the batches, and stay inside their ranges."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import qmc
from tests.sweep.conftest import QUANTITIES, small_plan

from tsis.sweep.plan import Range
from tsis.sweep.shards import sweep_batches

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.sweep.plan import Plan


def all_values(plan: Plan) -> dict[str, NDArray[np.float64]]:
    parts = [batch.values for batch in sweep_batches(plan)]
    return {name: np.concatenate([part[name] for part in parts]) for name in plan.quantities}


@pytest.mark.parametrize("batch", [1, 7, 64])
@pytest.mark.parametrize("sample", ["sobol", "latin-hypercube", "random"])
def test_they_are_those_of_scipy(sample: str, batch: int) -> None:
    found = all_values(small_plan(sample=sample, count=64, seed=11, batch=batch))
    draws = {
        "sobol": qmc.Sobol(3, rng=11).random(64),
        "latin-hypercube": qmc.LatinHypercube(3, rng=11).random(64),
        "random": np.random.default_rng(11).random((64, 3)),
    }
    unit = draws[sample]
    np.testing.assert_array_equal(found["diameter_mm"], 4.0 + 8.0 * unit[:, 0])
    np.testing.assert_array_equal(found["depth_mm"], 6.0 + 10.0 * unit[:, 1])
    np.testing.assert_allclose(found["young_kpa"], 20.0 * 10.0 ** unit[:, 2], rtol=1e-14)
    assert set(found["tissue_young_kpa"]) == {5.0}


@given(
    sample=st.sampled_from(["sobol", "latin-hypercube", "random"]),
    count=st.integers(1, 200),
    batch=st.integers(1, 60),
    seed=st.integers(0, 2**63 - 1),
    low=st.floats(0.2, 10.0),
    width=st.floats(1e-6, 10.0),
    logarithmic=st.booleans(),
)
def test_they_stay_in_range_and_repeat(
    sample: str, count: int, batch: int, seed: int, low: float, width: float, logarithmic: bool
) -> None:
    depth = Range(low=low, high=low + width, logarithmic=logarithmic)
    plan = small_plan(sample=sample, count=count, batch=batch, seed=seed, quantities={**QUANTITIES, "depth_mm": depth})
    found = all_values(plan)
    assert all(len(values) == count for values in found.values())
    assert found["depth_mm"].min() >= depth.low
    assert found["depth_mm"].max() <= depth.high
    for name, values in all_values(plan).items():
        np.testing.assert_array_equal(values, found[name])
    assert [batch.shard for batch in sweep_batches(plan)] == list(range(plan.shards))


def test_a_grid_is_every_combination_once() -> None:
    quantities = {**QUANTITIES, "diameter_mm": (4.0, 8.0, 10.0), "depth_mm": (6.0, 9.0), "young_kpa": 50.0}
    found = all_values(small_plan(sample="grid", count=None, seed=None, quantities=quantities, batch=4))
    pairs = list(zip(found["diameter_mm"].tolist(), found["depth_mm"].tolist(), strict=True))
    assert pairs == list(itertools.product((4.0, 8.0, 10.0), (6.0, 9.0)))


def test_a_million_samples_are_not_held() -> None:
    plan = small_plan(count=10_000_000, batch=100)
    first = list(itertools.islice(sweep_batches(plan), 3))
    assert [batch.first for batch in first] == [0, 100, 200]
