from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.errors import InputError, UnknownNameError
from tsis.model.require import require_array, require_integer, require_number, require_one_of


@given(st.floats(-1e300, 1e300), st.floats(-1e300, 1e300), st.floats(-1e300, 1e300))
def test_a_number_passes_exactly_when_its_range_holds_it(value: float, one: float, other: float) -> None:
    low, high = sorted((one, other))
    if low <= value <= high:
        assert require_number("force_n", value, low, high) == value
    else:
        with pytest.raises(InputError, match=r"^force_n must lie in \[.*\]; got "):
            require_number("force_n", value, low, high)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_number_must_be_finite(value: float) -> None:
    with pytest.raises(InputError, match="must lie in"):
        require_number("force_n", value, -math.inf, math.inf)


@pytest.mark.parametrize("value", [True, None, "1", [1.0], 1j, np.array([1.0, 2.0])])
def test_only_numbers_are_numbers(value: object) -> None:
    with pytest.raises(InputError, match=r"^force_n must be a number; got "):
        require_number("force_n", value, 0.0, 1.0)


@pytest.mark.parametrize("value", [1, np.int32(1), np.float32(1), 1.0])
def test_every_kind_of_real_number_becomes_a_float(value: object) -> None:
    assert type(require_number("force_n", value, 0.0, 1.0)) is float


@given(st.integers(), st.integers(), st.integers())
def test_a_whole_number_keeps_all_its_digits(value: int, one: int, other: int) -> None:
    low, high = sorted((one, other))
    if low <= value <= high:
        assert require_integer("seed", value, low, high) == value
    else:
        with pytest.raises(InputError, match=r"^seed must lie in \[.*\]; got "):
            require_integer("seed", value, low, high)


@pytest.mark.parametrize("value", [7, 7.0, np.int32(7), np.float32(7), np.uint64(7)])
def test_every_kind_of_whole_number_becomes_an_int(value: object) -> None:
    found = require_integer("bins", value, 1, 256)
    assert type(found) is int
    assert found == 7


@pytest.mark.parametrize("value", [True, None, "1", [1], 1j, 0.5, 1.9, np.float32(2.5), math.nan, math.inf])
def test_only_whole_numbers_are_whole(value: object) -> None:
    with pytest.raises(InputError, match=r"^bins must be a whole number; got .* \(of each side\)$"):
        require_integer("bins", value, 1, 256, hint="of each side")


@pytest.mark.parametrize("value", [10**400, -(10**400), 2**63, 1e300, np.uint64(2**64 - 1)])
def test_a_whole_number_out_of_range_is_refused_whatever_its_size(value: Any) -> None:
    with pytest.raises(InputError, match=r"^seed must lie in \[0, 9.22337e\+18\]; got "):
        require_integer("seed", value, 0, 2**63 - 1)


def test_the_hint_follows_the_value() -> None:
    with pytest.raises(InputError, match=r"^depth_mm must lie in \[0, 28\]; got 31 \(millimetres\)$"):
        require_number("depth_mm", 31.0, 0.0, 28.0, hint="millimetres")


def test_an_array_is_a_read_only_copy() -> None:
    source = [1.0, 2.0]
    result = require_array("radius_mm", source, ndim=1)
    source[0] = 9.0
    assert result.tolist() == [1.0, 2.0]
    assert not result.flags.writeable


@pytest.mark.parametrize(
    ("value", "phrase"),
    [
        ([[1.0]], r"must have 1 axes; got shape \(1, 1\)"),
        ([], r"must not be empty; got shape \(0,\)"),
        ([1.0, math.nan, math.inf], "must be finite; got 2 NaN or infinite values out of 3"),
        (["a"], "must be an array of numbers with 1 axes; got list"),
        ([[1.0], [1.0, 2.0]], "must be an array of numbers"),
    ],
)
def test_an_array_that_is_none_says_why(value: Any, phrase: str) -> None:
    with pytest.raises(InputError, match=f"^radius_mm {phrase}"):
        require_array("radius_mm", value, ndim=1)


def test_an_unknown_name_gets_the_nearest_one() -> None:
    assert require_one_of("probe", "flat", ("flat", "domed")) == "flat"
    with pytest.raises(
        UnknownNameError, match=r"no probe is called 'flatt'; did you mean 'flat'[?] known: domed, flat$"
    ):
        require_one_of("probe", "flatt", ("flat", "domed"))


@given(st.text())
def test_any_unknown_name_is_one_sentence(name: str) -> None:
    if name not in ("flat", "domed"):
        with pytest.raises(UnknownNameError) as caught:
            require_one_of("probe", name, ("flat", "domed"))
        assert "\n" not in str(caught.value)
