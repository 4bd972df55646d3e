"""The table of assumptions, and a spheroid that it presses."""

from __future__ import annotations

from typing import Any

import numpy as np
from benchmarks.assumptions import INCLUSION, _spheroid, rows_of

import tsis


def test_a_row_is_the_mean_error_in_standard_deviations() -> None:
    common: dict[str, Any] = {"failure": "x", "truth": [9.0, 6.0, 80.0], "sd": [0.5, 0.5, 10.0]}
    found = [
        common | {"mean": [10.0, 6.0, 70.0], "trusted": True, "flags": ["young_kpa_not_identified"]},
        common | {"mean": [9.0, 5.0, 70.0], "trusted": False, "flags": ["tilted"]},
        {"failure": "x", "refused": "too dark"},
        {"failure": "y", "refused": "too dark"},
    ]
    assert rows_of(found) == [
        ["x", "+1.0 ± 1.0", "-1.0 ± 1.0", "-1.0 ± 0.0", "1 of 2", "tilted"],
        ["y", "", "", "", "1 refused", ""],
    ]


def test_a_spheroid_has_the_volume_of_the_sphere() -> None:
    target = tsis.Phantom(young_kpa=5.0, poisson=0.49, thickness_mm=30.0, inclusion=INCLUSION)
    changed, _ = _spheroid(0.7)(target, target)
    assert changed.inclusion is not None
    axes = changed.inclusion.semi_axes_mm
    assert axes is not None
    assert np.isclose(np.prod(axes), (INCLUSION.diameter_mm / 2) ** 3)
    assert np.isclose(axes[2] / axes[0], 0.7)
