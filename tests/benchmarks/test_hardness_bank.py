"""The benchmark's bank of solved presses gives the fields that are solved anew."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from benchmarks.hardness import summary, wilson
from benchmarks.hardness_bank import SolvedSphere

import tsis
from tsis.hardness.sphere import hertzian_radius_mm, press_fields
from tsis.model.phantom import SoftSphere
from tsis.virtual.direct_contact import DIRECT_CONTACT_RESOLUTION

PROBE = tsis.load_probe("tsis-direct")


@pytest.mark.slow
def test_an_interpolated_press_is_the_solved_one() -> None:
    bank = SolvedSphere(probe=PROBE, radius_mm=3.0, poisson=0.48, young_kpa=(188.0, 200.0, 214.0), forces_n=(0.4, 0.7))
    sphere, forces = SoftSphere(radius_mm=3.0, young_kpa=193.0, poisson=0.48), [0.39, 0.72]
    kept = bank(PROBE, sphere, forces_n=forces, resolution=DIRECT_CONTACT_RESOLUTION)
    solved = press_fields(PROBE, sphere, forces_n=forces, resolution=DIRECT_CONTACT_RESOLUTION)
    for one, other in zip(kept, solved, strict=True):
        # The mesh's own ripple is some thousandths; what interpolation adds hides in it.
        assert hertzian_radius_mm(one) == pytest.approx(hertzian_radius_mm(other), rel=2e-3)
        carried = np.trapezoid(2e-3 * np.pi * one.radius_mm * one.pressure_kpa, one.radius_mm)
        assert carried == pytest.approx(one.force_n, rel=1e-9)


def test_the_summary_counts_what_lies_inside() -> None:
    answers: list[dict[str, Any]] = [
        {"mean": 110.0, "half": (105.0, 115.0), "most": (95.0, 125.0), "trusted": True, "flags": ()},
        {"mean": 100.0, "half": (95.0, 105.0), "most": (90.0, 110.0), "trusted": True, "flags": ("one_force",)},
        {"refused": "no contact"},
    ]
    result = summary([100.0, 100.0, 100.0], answers)
    assert result["mean_relative_error"] == pytest.approx(0.05)
    assert (result["trusted"], result["refused"], result["flags"]) == (2, 1, {"one_force": 1})
    assert (result["coverage_50"], result["coverage_90"]) == (0.5, 1.0)


def test_wilson_holds_the_share_and_is_not_symmetric_near_one() -> None:
    low, high = wilson(90, 100)
    assert (low, high) == pytest.approx((0.8256, 0.9448), abs=1e-3)  # Newcombe's tables
