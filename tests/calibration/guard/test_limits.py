"""The guard's flags and limits: each has a range, and the page of the documents names all."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import pytest

from tsis.calibration.guard.limits import GUARD_FLAGS, GuardLimits
from tsis.errors import InputError

PAGE = Path(__file__).resolve().parents[3] / "docs" / "how-to" / "watch-a-press.md"


@pytest.mark.parametrize("name", [one.name for one in fields(GuardLimits)])
def test_every_limit_has_a_range(name: str) -> None:
    within = {flag.limit: flag.within for flag in GUARD_FLAGS.values()} | {"release": (0.5, 1.0)}
    low, high = within[name]
    for wrong in (low - 1.0, high + 1.0, float("nan")):
        with pytest.raises(InputError, match=name):
            GuardLimits(**{name: wrong})


def test_an_empty_window_of_force_is_refused() -> None:
    with pytest.raises(InputError, match="below"):
        GuardLimits(least_force_n=2.0, most_force_n=1.0)


def test_the_page_names_every_flag_with_its_meaning_and_its_limit() -> None:
    rows = [line.strip("| ").split(" | ") for line in PAGE.read_text().splitlines() if line.startswith("| `")]
    result = {cells[0].strip("`"): cells[1:4] for cells in rows}
    assert result == {
        name: [one.means, f"{getattr(GuardLimits(), one.limit):g} {one.unit}", one.needs or "-"]
        for name, one in GUARD_FLAGS.items()
    }
