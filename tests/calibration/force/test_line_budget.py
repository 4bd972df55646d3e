"""The budget of a force by the line, against the variance of the sum written out."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.calibration.file.bench import bench_line, measured

from tsis.calibration.file import ProbeCalibration
from tsis.calibration.frames import UsableCalibration
from tsis.calibration.measured import MeasuredValue
from tsis.errors import CalibrationError
from tsis.model.calibration import Calibration


def test_the_budget_of_a_force_is_its_uncertainty() -> None:
    line = bench_line(
        unit_covariance=(4e4, 1e3, 9e6),
        residual_grey=MeasuredValue(value=300.0, sd=10.0, degrees_of_freedom=20.0, unit="grey"),
        residual_share=measured(0.01),
        assumed_tip_share=0.02,
        drift_share=0.01,
        gauge_share=0.005,
    )
    force, slope = 0.8, line.slope_grey_per_n.value
    budget = line.budget(force)
    units = (4e4 + 2e3 * force + 9e6 * force**2) * (1 + 1 / line.units) / slope**2
    others = (300.0 / slope) ** 2 + force**2 * (0.01**2 + 0.02**2 + 0.01**2 + 0.005**2)
    assert budget.combined == pytest.approx(math.sqrt(units + others))
    assert (line.with_uncertainty(force).sd, line.with_uncertainty(force).degrees_of_freedom) == (
        budget.combined,
        budget.degrees_of_freedom,
    )
    low, high = line.with_uncertainty(force).interval(0.95)
    assert budget.expanded == pytest.approx((high - low) / 2)
    assert [part.evaluation for part in budget.components] == ["A", "A", "A", "B", "B", "B"]
    assert budget.components[-1].sensitivity == pytest.approx(force)


def test_a_force_on_soft_tissue_spreads_as_its_line_and_ratio_drawn_at_random() -> None:
    ratio = MeasuredValue(value=0.8, sd=0.02, degrees_of_freedom=9.0)
    line = bench_line(soft_ratio=ratio)
    total = 900.0 + 1e5 * 0.6
    tips, soft = line.force_n(total), line.soft_force_n(total)
    rng = np.random.default_rng(24)
    drawn = rng.normal(tips.value, tips.sd, 200_000) / rng.normal(ratio.value, ratio.sd, 200_000)
    assert soft.value == pytest.approx(0.6 / 0.8)
    assert soft.sd == pytest.approx(drawn.std(), rel=0.02)
    assert min(tips.degrees_of_freedom, 9.0) <= soft.degrees_of_freedom <= tips.degrees_of_freedom + 9.0
    assert bench_line().soft_force_n(total) == tips


def test_a_stated_force_has_the_uncertainty_of_the_response() -> None:
    response = Calibration(gain_grey_per_kpa=60.0, saturation_kpa=20.0, force_sd=0.02)
    usable = UsableCalibration(calibration=ProbeCalibration(name="rig", response=response), identity="0" * 64)
    budget = usable.force_budget(1.5, by_line=False)
    assert budget.combined == pytest.approx(0.03)
    assert (budget.unit, len(budget.components)) == ("N", 1)
    with pytest.raises(CalibrationError, match="needs the part 'force_line'"):
        usable.force_budget(1.5, by_line=True)
