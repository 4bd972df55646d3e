"""Numbers as people type and read them."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.console.pages.components import number_text_of_field, typed_number
from tsis.errors import InputError


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_what_a_float_prints_is_typed_back(value: float) -> None:
    assert typed_number("force", repr(value)) == value
    assert typed_number("force", f"  {value:.17e} ") == value


@given(st.floats(min_value=-1e6, max_value=1e6))
def test_what_is_shown_is_a_number_near_by(value: float) -> None:
    assert math.isclose(typed_number("force", number_text_of_field(value)), value, rel_tol=1e-4, abs_tol=1e-300)


@given(st.text())
def test_text_is_a_number_as_python_reads_it_or_one_sentence(text: str) -> None:
    refusal = ""
    try:
        value = typed_number("force", text)
    except InputError as error:
        refusal = str(error)
    else:
        assert value == float(text)
    assert refusal.startswith("force must be a number") == bool(refusal)
    assert "\n" not in refusal


@pytest.mark.parametrize("text", ["", "one", "1,5", "1_0", "nan", "inf", "-", ".", "e5", "0x10", "١", "1 2", "1\n2"])
def test_no_number(text: str) -> None:
    with pytest.raises(InputError, match=r"force must be a number, as 2 or 0\.5; got"):
        typed_number("force", text)


def test_a_number_too_large_for_one_is_infinite_for_the_bench_to_refuse() -> None:
    assert typed_number("force", "1e999") == math.inf


def test_nothing_is_shown_of_nothing() -> None:
    assert number_text_of_field(None) == ""
    assert number_text_of_field(5.0) == "5"
    assert number_text_of_field(0.01) == "0.01"
