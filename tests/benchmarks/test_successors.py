"""The table of stated phantoms, on numbers done by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from benchmarks.successors import DEPTH_MM, EVALUATED, PRIOR, SPHERES, relative_errors, sphere, sphere_rows, totals

from tsis.inclusion.prior import PARAMETERS


def test_every_stated_sphere_lies_well_inside_the_prior() -> None:
    for number in range(len(SPHERES)):
        inclusion = sphere(number).inclusion
        assert inclusion is not None
        truth = np.array([getattr(inclusion, name) for name in PARAMETERS])
        assert ((truth >= PRIOR.low / 0.75) & (truth <= 0.9 * PRIOR.high)).all()


def test_a_row_is_the_mean_over_repeats_beside_what_others_print() -> None:
    common = {"number": 3, "truth": [10.0, DEPTH_MM, 40.0], "sd": [0.5, 0.5, 8.0], "trusted": True}
    lines: list[dict[str, Any]] = [
        {"case": "3-0", **common, "mean": [11.0, 10.0, 30.0], "identified": [True, True, True]},
        {"case": "3-1", **common, "mean": [10.0, 9.0, 40.0], "identified": [True, True, False]},
        {"case": "4-0", "refused": "too dark"},
    ]
    rows = sphere_rows(lines)
    assert rows[3] == ["10 mm, 40 kPa", "10", "5", "5", "5", "12.5", "20", "1 of 2", "2 of 2"]
    assert rows[4][-2:] == ["refused", ""]
    assert totals(lines)[0][3:] == ["5", "5", "12.5", "", "25 where identified", ""]


def test_their_table_does_not_quite_bear_out_their_typical_errors() -> None:
    size, modulus = relative_errors(EVALUATED, SPHERES).mean(axis=0)
    assert size == pytest.approx(7.47, abs=0.01)  # "typical" 5 %
    assert modulus == pytest.approx(3.49, abs=0.01)  # "typical" 10 %
