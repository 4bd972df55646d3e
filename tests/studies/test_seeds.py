"""Which values are set side by side."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from studies.seeds import scatter
from studies.shown import Shown

if TYPE_CHECKING:
    from collections.abc import Mapping


def drawn(rng: np.random.Generator) -> Mapping[str, float]:
    return {"a": float(rng.normal()), "b": 2.0}


def drawn_short(rng: np.random.Generator) -> Mapping[str, float]:
    return {"a": 10.0 + float(rng.normal())}


def test_each_seed_has_a_value_and_the_short_run_the_last() -> None:
    steps: list[tuple[int, int]] = []
    shown = Shown(name="figure-0", run=drawn, short=drawn_short, values=lambda found: found)
    found = scatter([shown], 3, progress=lambda *step: steps.append(step))["figure-0"]
    first = float(np.random.default_rng(1).normal())
    assert found["a"][0] == first
    assert found["a"][-1] == 10.0 + first
    assert len(set(found["a"])) == 4
    assert found["b"][:3] == [2.0, 2.0, 2.0]
    assert math.isnan(found["b"][-1])
    assert steps == [(turn, 4) for turn in range(4)]
