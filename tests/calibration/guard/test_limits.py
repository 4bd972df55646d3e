"""The guard's limits: each has a range."""

from __future__ import annotations

from dataclasses import fields

import pytest

from tsis.calibration.guard.limits import GUARD_FLAGS, GuardLimits
from tsis.errors import InputError


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
