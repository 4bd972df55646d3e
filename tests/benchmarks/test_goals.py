"""What a benchmark says of numbers that miss their goals."""

from __future__ import annotations

import math

import pytest
from benchmarks.goals import Goal, missed_goals


def test_a_number_that_is_missed_is_said_and_ends_the_program_with_1(capsys: pytest.CaptureFixture[str]) -> None:
    fine = [Goal(name="rate", value=30.0, least=30.0), Goal(name="anything", value=math.inf)]
    assert missed_goals(fine) == 0
    assert capsys.readouterr().out == ""
    assert missed_goals([*fine, Goal(name="age", value=61.0, most=60.0, form="{:.0f} ms")]) == 1
    assert capsys.readouterr().out == "missed: age is 61 ms, its goal <= 60 ms\n"


@pytest.mark.parametrize(
    ("value", "least", "most", "goal"), [(math.nan, 1.0, math.inf, ">= 1.0"), (4.0, 1.0, 3.0, ">= 1.0 and <= 3.0")]
)
def test_what_lies_elsewhere_or_is_no_number_is_missed(value: float, least: float, most: float, goal: str) -> None:
    one = Goal(name="rate", value=value, least=least, most=most)
    assert not one.met
    assert one.row == ("rate", f"{value:.1f}", goal)
