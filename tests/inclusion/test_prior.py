"""The prior: what it refuses, and the box that its surrogate must cover."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tsis.errors import InputError
from tsis.inclusion import InclusionPrior

PRIOR = InclusionPrior()


def test_the_default_is_the_dissertations_range() -> None:
    assert PRIOR.low.tolist() == [1.0, 4.0, 40.0]
    assert PRIOR.high.tolist() == [15.0, 12.0, 120.0]
    assert PRIOR.sd["young_kpa"] == pytest.approx(80 / np.sqrt(12))


def test_the_box_covers_the_beliefs_about_the_tissue() -> None:
    box = PRIOR.box()
    assert (box.diameter_mm, box.depth_mm, box.young_kpa) == (PRIOR.diameter_mm, PRIOR.depth_mm, PRIOR.young_kpa)
    assert box.tissue_young_kpa[0] < 5.0 * 0.8 < 5.0 * 1.2 < box.tissue_young_kpa[1]
    assert box.thickness_mm[0] < 30.0 * 0.95 < 30.0 * 1.15 < box.thickness_mm[1]
    assert box.thickness_mm[0] > PRIOR.depth_mm[1] + PRIOR.diameter_mm[1]


@pytest.mark.parametrize(
    ("changes", "phrase"),
    [
        ({"diameter_mm": (5.0, 2.0)}, r"the high end of diameter_mm must lie in .* got 2 \(above the low end\)"),
        ({"depth_mm": (0.0, 2.0)}, "the low end of depth_mm must lie in .* got 0"),
        ({"young_kpa": (40.0, 60.0, 80.0)}, "young_kpa must hold two numbers"),
        ({"young_kpa": (40.0, np.nan)}, "young_kpa must be finite"),
        ({"tissue_young_kpa": 0.0}, "tissue_young_kpa must lie in"),
        ({"tissue_young_sd": 0.0}, r"tissue_young_sd must lie in .*\(a fraction\)"),
        ({"thickness_sd": 0.5}, "thickness_sd must lie in"),
        ({"thickness_mm": 27.0}, r"depth_mm \+ diameter_mm must be less than thickness_mm = 27 by 2 %; got 27"),
        ({"young_kpa": (5.0, 60.0)}, "young_kpa must lie above tissue_young_kpa"),
        ({"poisson": 0.5}, "poisson must lie in"),
    ],
)
def test_what_a_prior_refuses(changes: dict[str, Any], phrase: str) -> None:
    with pytest.raises(InputError, match=phrase):
        replace(PRIOR, **changes)
