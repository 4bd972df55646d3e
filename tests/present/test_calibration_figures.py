from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from tsis.calibration.force_line import ForceLine, Loading, loading_forces
from tsis.calibration.measured import MeasuredValue
from tsis.present.figures import force_residuals, force_sums, hysteresis_loops

SLOPE = 4e5


def loading(tip_mm: float, loop: float, *, unloaded: bool = True) -> Loading:
    force = np.array(loading_forces(2.0, 0.2))[: None if unloaded else 11]
    sums = SLOPE * force
    rising = np.arange(len(force)) <= int(force.argmax())
    sums = sums + np.where(rising, 0.0, -loop * SLOPE * force * (2.0 - force))
    none = np.zeros_like(force)
    return Loading(
        tip_radius_mm=tip_mm,
        force_n=force,
        total_grey=sums,
        touched=force > 0,
        field_grey=sums,
        peak_grey=none,
        mean_square_mm2=none,
        clipped=none,
    )


def line() -> ForceLine:
    return ForceLine(
        intercept_grey=MeasuredValue(value=0.0, sd=100.0),
        slope_grey_per_n=MeasuredValue(value=SLOPE, sd=1000.0),
        unit_covariance=(1e4, 0.0, 1e6),
        units=3,
        residual_grey=MeasuredValue(value=100.0, sd=1.0),
        residual_share=MeasuredValue(value=0.002, sd=0.0),
        least_n=0.1,
        most_n=2.0,
        pixels=55296,
        full_scale=255.0,
        tips_mm=(2.0, 10.0),
    )


def test_every_press_is_drawn_where_it_lies() -> None:
    runs = [loading(2.0, 0.0), loading(10.0, 0.0)]
    ax = force_sums(runs, line(), Figure().subplots())
    rings = ax.get_lines()[0]
    assert np.allclose(rings.get_xdata(), runs[0].load_n[runs[0].touched & runs[0].rising])
    assert np.allclose(np.asarray(rings.get_ydata()) * 1e6, SLOPE * np.asarray(rings.get_xdata()))
    _, names = ax.get_legend_handles_labels()
    assert names == ["2 mm tip", "10 mm tip", "95 % of new frames"]


def test_a_straight_line_leaves_no_residual() -> None:
    ax = force_residuals([loading(2.0, 0.0)], line(), Figure().subplots())
    assert np.allclose(np.asarray(ax.get_lines()[0].get_ydata()), 0.0, atol=1e-9)


def test_the_loop_is_drawn_in_per_cent_of_the_range() -> None:
    ax = hysteresis_loops([loading(2.0, 0.01)], Figure().subplots())
    drawn = np.asarray(ax.get_lines()[0].get_ydata())
    # loop * F (2 - F) over 2 is loop / 2 at 1 N; linear between presses it is a little less
    assert drawn.max() == pytest.approx(100 * 0.01 / 2, rel=0.02)


def test_loadings_without_unloading_say_that_there_is_no_loop() -> None:
    ax = hysteresis_loops([loading(2.0, 0.01, unloaded=False)], Figure().subplots())
    assert [text.get_text() for text in ax.texts] == ["no tip was unloaded"]
    assert len(ax.get_lines()) == 1  # zero
