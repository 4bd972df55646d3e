"""Samples are those that SciPy draws; a file is decided by its content, and whatever changed in it is seen."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import qmc
from tests.sweep.stand_ins import QUANTITIES, quick, refusing, small_plan

from tsis.sweep.plan import Range
from tsis.sweep.shards import decode_shard, encode_shard, press_all, receipt_of, sha256, sweep_batches

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.sweep.plan import Plan


PLAN = small_plan(forces_n=(0.5, 1.0))
ROWS = press_all(PLAN, next(sweep_batches(PLAN)), quick)
KEY = "a" * 64
CONTENT = encode_shard(ROWS, shard=3, data_set=KEY)


def is_whole(content: bytes) -> bool:
    return receipt_of(content, shard=3, data_set=KEY) is not None


def test_equal_rows_are_equal_bytes() -> None:
    again = encode_shard(press_all(PLAN, next(sweep_batches(PLAN)), quick), shard=3, data_set=KEY)
    assert again == CONTENT
    assert encode_shard(ROWS, shard=4, data_set=KEY) != CONTENT


def test_a_receipt_names_what_is_in_the_file() -> None:
    receipt = receipt_of(CONTENT, shard=3, data_set=KEY)
    assert receipt is not None
    assert (receipt.rows, receipt.refused, receipt.sha256) == (20, 0, sha256(CONTENT))


def test_a_foreign_file_has_no_receipt() -> None:
    assert receipt_of(CONTENT, shard=4, data_set=KEY) is None
    assert receipt_of(CONTENT, shard=3, data_set="b" * 64) is None


@given(where=st.integers(0, len(CONTENT) - 1), bit=st.integers(0, 7))
def test_one_flipped_bit_anywhere_is_seen(where: int, bit: int) -> None:
    damaged = bytearray(CONTENT)
    damaged[where] ^= 1 << bit
    assert not is_whole(bytes(damaged))


@given(size=st.integers(0, len(CONTENT) - 1), zeros=st.booleans())
def test_a_cut_file_is_seen(size: int, zeros: bool) -> None:
    cut = CONTENT[:size]
    assert not is_whole(cut.ljust(len(CONTENT), b"\0") if zeros else cut)


@given(data=st.binary(max_size=300))
def test_any_other_bytes_are_no_file(data: bytes) -> None:
    assert not is_whole(data)


def test_what_was_encoded_is_decoded() -> None:
    rows = decode_shard(CONTENT)
    assert rows.sample.tolist() == [k // 2 for k in range(20)]
    assert rows.numbers["force_n"].tolist() == [0.5, 1.0] * 10
    assert rows.error == ROWS.error
    assert list(rows.numbers) == list(ROWS.numbers)
    for name, values in ROWS.numbers.items():
        np.testing.assert_array_equal(rows.numbers[name], values)
    assert rows.numbers["pressure_kpa"].shape == (20, 3)


def test_a_refused_press_is_a_row_that_says_why() -> None:
    plan = small_plan(quantities={**PLAN.quantities, "young_kpa": 160.0})
    rows = press_all(plan, next(sweep_batches(plan)), refusing)
    receipt = receipt_of(encode_shard(rows, shard=0, data_set=KEY), shard=0, data_set=KEY)
    assert receipt is not None
    assert (receipt.rows, receipt.refused) == (10, 10)
    assert rows.error[0] == "MechanicsError: young_kpa must be at most 150; got 160"
    assert np.isnan(rows.numbers["pressure_kpa"]).all()
    assert np.isnan(rows.numbers["approach_mm"]).all()


def test_an_inclusion_that_does_not_fit_is_such_a_row() -> None:
    plan = small_plan(quantities={**PLAN.quantities, "thickness_mm": 20.0}, unfit="keep", batch=60)
    rows = press_all(plan, next(sweep_batches(plan)), quick)
    bottom = rows.numbers["depth_mm"] + rows.numbers["diameter_mm"]
    assert [bool(text) for text in rows.error] == (bottom >= 20.0).tolist()
    assert 0 < rows.refused < 60


def test_a_fault_of_the_program_is_no_row() -> None:
    def wrong(*_: object, **__: object) -> None:
        raise TypeError

    with pytest.raises(TypeError):
        press_all(PLAN, next(sweep_batches(PLAN)), wrong)  # type: ignore[arg-type]


def test_the_change_is_that_against_plain_tissue() -> None:
    plan = small_plan(columns=("change_by_inclusion_mm",))
    batch = next(sweep_batches(plan))
    rows = press_all(plan, batch, quick)
    phantom = plan.phantom({name: float(values[0]) for name, values in batch.values.items()})
    with_it, without = (
        quick(plan.probe, one, force_n=1.0, strain="small") for one in (phantom, phantom.without_inclusion())
    )
    change = with_it.face_displacement_mm - without.face_displacement_mm
    np.testing.assert_allclose(
        rows.numbers["change_by_inclusion_mm"][0], np.interp(plan.radii_mm, with_it.radius_mm, change), rtol=1e-14
    )


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
