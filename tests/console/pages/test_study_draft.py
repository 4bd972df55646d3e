"""Fields of a new study: a size only for counts that can be made."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from tsis.console.pages.study import StudyDraft
from tsis.errors import InputError


@pytest.mark.parametrize("typed", ["-1", "1e9", "1e999", "2.5", "", "x"])
def test_a_count_that_no_study_can_have_has_no_size(typed: str) -> None:
    for field, label in (("present", "targets with an inclusion"), ("blank", "blanks")):
        with pytest.raises(InputError, match=f"^{label} must "):
            StudyDraft(**dict[str, Any]({field: typed})).size()


def test_readings_and_presses_are_counted() -> None:
    size = replace(StudyDraft(), present="6", blank="2", repeats="3", forces="0.5, 1").size()
    assert (size.readings, size.presses) == (24, 96)
    size = replace(StudyDraft(), present="100000", blank="0", forces="1", with_reference=False).size()
    assert (size.readings, size.presses) == (100_000, 100_000)
