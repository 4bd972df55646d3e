from __future__ import annotations

from dataclasses import FrozenInstanceError
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from tsis.errors import InputError
from tsis.model.estimate import INTERVAL_LEVEL, NO_UNIT, UNITS, Estimate, label_of, unit_of

if TYPE_CHECKING:
    from numpy.typing import NDArray


SAMPLES = hnp.arrays(float, st.integers(1, 200), elements=st.floats(-1e3, 1e3))


def _estimate(values: Any, prior_sd: float = 2.0) -> Estimate:
    return Estimate(samples={"depth_mm": values}, prior_sd={"depth_mm": prior_sd})


@given(SAMPLES, st.floats(0.01, 0.99))
def test_summaries_are_those_of_numpy(values: NDArray[np.float64], level: float) -> None:
    estimate = _estimate(values)
    assert estimate.mean["depth_mm"] == np.mean(values)
    assert estimate.sd["depth_mm"] == np.std(values)
    assert estimate.narrowing["depth_mm"] == np.std(values) / 2.0
    low, high = estimate.interval(level)["depth_mm"]
    assert (low, high) == tuple(np.quantile(values, [0.5 - level / 2, 0.5 + level / 2]))
    assert values.min() <= low <= high <= values.max()


@given(SAMPLES)
def test_wider_levels_hold_narrower_ones(values: NDArray[np.float64]) -> None:
    narrow, wide = (_estimate(values).interval(level)["depth_mm"] for level in (0.5, 0.9))
    assert wide[0] <= narrow[0] + 1e-9
    assert narrow[1] <= wide[1] + 1e-9


def test_an_interval_of_a_normal_sample_has_its_textbook_width() -> None:
    values = np.random.default_rng(0).normal(5.0, 2.0, 200_000)
    low, high = _estimate(values).interval(0.9)["depth_mm"]
    assert low == pytest.approx(5.0 - 2.0 * 1.6449, abs=0.03)
    assert high == pytest.approx(5.0 + 2.0 * 1.6449, abs=0.03)


@pytest.mark.parametrize("level", [0.0, 1.0, -0.1, 1.1, float("nan")])
def test_a_level_is_a_share_between_none_and_all(level: float) -> None:
    with pytest.raises(InputError, match="level must lie in"):
        _estimate([1.0, 2.0]).interval(level)


def test_an_estimate_cannot_be_changed() -> None:
    values = np.array([1.0, 2.0, 3.0])
    estimate = _estimate(values)
    values[:] = 0.0
    assert estimate.mean["depth_mm"] == 2.0
    with pytest.raises(FrozenInstanceError):
        estimate.flags = ("changed",)  # type: ignore[misc]
    with pytest.raises(ValueError, match="read-only"):
        estimate.samples["depth_mm"][0] = 9.0
    with pytest.raises(TypeError, match="item assignment"):
        estimate.samples["young_kpa"] = values  # type: ignore[index]
    with pytest.raises(TypeError, match="item assignment"):
        estimate.provenance["seed"] = 1  # type: ignore[index]


def test_samples_and_priors_name_the_same_parameters() -> None:
    with pytest.raises(InputError, match="samples and prior_sd must name the same parameters"):
        Estimate(samples={"depth_mm": np.array([1.0])}, prior_sd={"young_kpa": 1.0})


@pytest.mark.parametrize("values", [[], [np.nan], [[1.0]]])
def test_samples_are_finite_lists(values: Any) -> None:
    with pytest.raises(InputError, match="depth_mm must"):
        _estimate(values)


def test_a_parameter_is_identified_unless_its_own_flag_says_not() -> None:
    estimate = Estimate(
        samples={"depth_mm": np.array([4.0]), "young_kpa": np.array([80.0])},
        prior_sd={"depth_mm": 1.0, "young_kpa": 1.0},
        flags=("young_kpa_not_identified", "off_axis"),
    )
    assert estimate.identified("depth_mm")
    assert not estimate.identified("young_kpa")


@pytest.mark.parametrize(
    ("name", "words", "unit"),
    [
        ("young_kpa", "Young's modulus", "kPa"),
        ("long_axis_mm", "long axis", "mm"),
        ("angle_deg", "angle", "deg"),
        ("force_n", "force", "N"),
        ("presence", "presence", NO_UNIT),
        ("_mm_left", " mm left", NO_UNIT),
    ],
)
def test_the_ending_says_the_unit_and_the_rest_the_words(name: str, words: str, unit: str) -> None:
    assert (label_of(name), unit_of(name)) == (words, unit)


def test_no_ending_hides_another() -> None:
    assert not [(one, other) for one in UNITS for other in UNITS if one != other and one.endswith(other)]


def test_the_interval_that_is_told_is_the_one_that_an_estimate_gives_unasked() -> None:
    estimate = Estimate(samples={"depth_mm": np.array([0.0, 5.0, 10.0, 20.0])}, prior_sd={"depth_mm": 2.0})
    assert estimate.interval() == estimate.interval(INTERVAL_LEVEL) != estimate.interval(0.8)
