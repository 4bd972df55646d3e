"""Numbers as people type and read them."""

from __future__ import annotations

import asyncio
import math
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.console.pages.open_page import RecordingViewer, on_a_page
from tests.console.services.instruments import lit_instrument

from tsis.console.widgets import NumberField, number_text_of_field, typed_number
from tsis.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path


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


def test_a_state_that_comes_meanwhile_does_not_replace_what_is_refused(tmp_path: Path) -> None:
    async def typed(viewer: RecordingViewer) -> None:
        field = NumberField(viewer, "Force", lambda _: None)
        field.show(1.5)

        async def refusal(act: Callable[[], object]) -> InputError:
            field.show(1.5)  # the page follows the instrument while it refuses
            with pytest.raises(InputError):
                act()
            return InputError("refused")

        viewer.refusal = refusal  # type: ignore[method-assign]
        field._typed()
        field.element.value = "hard"
        await field._done()
        assert (field.element.value, field.element.error) == ("hard", "refused.")

    with lit_instrument(tmp_path) as instrument:
        on_a_page(instrument, typed)


def test_the_answer_to_an_earlier_number_does_not_replace_a_later_one(tmp_path: Path) -> None:
    arrived: list[float] = []

    async def typed(viewer: RecordingViewer) -> None:
        answers: asyncio.Queue[None] = asyncio.Queue()

        async def refusal(act: Callable[[], object]) -> InputError | None:
            act()
            await answers.get()
            return InputError("too large") if arrived[-1] > 24 else None

        viewer.refusal = refusal  # type: ignore[method-assign]
        field = NumberField(viewer, "Gain", arrived.append)
        field.show(2.0)
        sent = []
        for text in ("7.5", "25"):
            field._typed()
            field.element.value = text
            sent.append(asyncio.create_task(field._done()))
            await asyncio.sleep(0)
        answers.put_nowait(None)
        await sent[0]
        assert (field.element.value, field.element.error) == ("25", None)
        answers.put_nowait(None)
        await sent[1]
        assert (field.element.value, field.element.error) == ("25", "Too large.")
        field.show(0.0)
        assert (field.element.value, field.element.error) == ("0", None)

    with lit_instrument(tmp_path) as instrument:
        on_a_page(instrument, typed)
    assert arrived == [7.5, 25.0]
