"""The table of stated phantoms, on numbers done by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from benchmarks.successors import DEPTH_MM, EVALUATED, PRIOR, SPHERES, relative_errors, rows_of, sphere

from tsis.inclusion.prior import PARAMETERS


def test_every_stated_sphere_lies_well_inside_the_prior() -> None:
    for number in range(len(SPHERES)):
        inclusion = sphere(number).inclusion
        assert inclusion is not None
        truth = np.array([getattr(inclusion, name) for name in PARAMETERS])
        assert ((truth >= PRIOR.low / 0.75) & (truth <= 0.9 * PRIOR.high)).all()


def test_a_row_is_the_mean_over_repeats_beside_what_others_print() -> None:
    lines: list[dict[str, Any]] = [
        {"number": number, "truth": [float(d), DEPTH_MM, float(young)], "sd": [0.5, 0.5, young / 5]}
        | {"mean": [d * wide, deep, young * stiff]}
        for number, (d, young) in enumerate(SPHERES)
        for wide, deep, stiff in ((1.1, 10.0, 0.75), (1.0, 9.0, 1.0))
    ]
    rows = rows_of(lines)
    assert rows[3] == ["10 mm, 40 kPa", "10", "5", "5", "5", "12.5", "20"]
    assert rows[-2] == ["mean", "7.46", "3.49", "5", "5", "12.5", ""]


def test_their_table_does_not_quite_bear_out_their_typical_errors() -> None:
    size, modulus = relative_errors(EVALUATED, SPHERES).mean(axis=0)
    assert size == pytest.approx(7.47, abs=0.01)  # "typical" 5 %
    assert modulus == pytest.approx(3.49, abs=0.01)  # "typical" 10 %
