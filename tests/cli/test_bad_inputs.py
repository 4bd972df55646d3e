"""Bad input costs one sentence, without a traceback; a value in another unit is suspected by its scale."""

from __future__ import annotations

import pytest
from tests.cli.bad_inputs import CASES, answers

from tsis.errors import InputError
from tsis.model.require import require_number

QUICK = ("force nan", "depth in m", "empty file", "dead link", "device file", "claimed 1 GB", "misspelt option")


def test_a_sentence_is_all_that_is_said() -> None:
    for each in answers(QUICK):
        assert (each.code, [fault for fault in each.faults if fault != "slow"]) == (2, []), each.name


@pytest.mark.slow
def test_every_case_is_served_or_refused_in_a_sentence() -> None:
    wrong = {each.name: each.faults for each in answers() if set(each.faults) - {"slow"}}
    assert wrong == {}
    assert len(CASES) > 40


@pytest.mark.parametrize(
    ("value", "hint", "said"),
    [
        (500.0, "newtons", "got 500 (newtons); that would be 0.5 if it was given in millinewtons"),
        (0.004, "millimetres per pixel", "; that would be 4 if it was given in metres"),
        (90000.0, "kilopascals", "; that would be 90 if it was given in pascals"),
    ],
)
def test_another_unit_is_suspected(value: float, hint: str, said: str) -> None:
    with pytest.raises(InputError) as refused:
        require_number("x", value, 0.1, 100.0, hint=hint)
    assert said in str(refused.value)


@pytest.mark.parametrize(("value", "hint"), [(-500.0, "newtons"), (1e9, "newtons"), (500.0, "seconds"), (500.0, "")])
def test_nothing_is_suspected_where_no_unit_would_help(value: float, hint: str) -> None:
    with pytest.raises(InputError) as refused:
        require_number("x", value, 0.1, 100.0, hint=hint)
    assert "would be" not in str(refused.value)
