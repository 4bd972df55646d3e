"""The study's lines: sums that follow the force for every tip, and cross-sections that are Hertz's."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure
from studies.force_line import (
    COARSE,
    FINE,
    PROBE,
    SHOWN,
    Result,
    contact_radii,
    gaussian,
    half_ellipse,
    report,
    row_values,
    run,
)
from studies.section_5_1 import FORCES_N, PRINTED_DIFFERENCE, SENSOR, TIPS_MM

from tsis.mechanics.finite_strain.soft_sphere import SphereResolution
from tsis.mechanics.small_strain.rigid_ball import indent

pytestmark = pytest.mark.slow  # the gallery's tests see the same numbers in every run


@pytest.fixture(scope="module")
def result() -> Result:
    return run(resolution=COARSE)


@pytest.mark.parametrize("tip_mm", TIPS_MM)
def test_sums_are_a_straight_line_up_and_down(result: Result, tip_mm: float) -> None:
    line = result.line(tip_mm)
    assert line.r_squared > 0.9999
    assert line.exponent == pytest.approx(1.0, abs=0.02)
    assert result.residual(tip_mm) < 0.005
    assert result.hysteresis(tip_mm) < 0.005


@pytest.mark.parametrize("tip_mm", TIPS_MM)
def test_a_sum_is_the_force_times_the_gain_over_a_pixels_area(result: Result, tip_mm: float) -> None:
    """Brightness of 0.8 of the scale above the background at 700 kPa, mN over pixels of 0.0336 x 0.0392 mm."""
    slope = 0.8 * (SENSOR.full_scale - SENSOR.background_grey) / 700.0 * 1000.0 / (0.0336 * 0.0392)
    np.testing.assert_allclose(result.expected[tip_mm], slope * FORCES_N, rtol=0.02)
    assert result.line(tip_mm).slope_per_n == pytest.approx(slope, rel=0.02)


def test_the_wide_tips_differ_by_less_than_printed(result: Result) -> None:
    assert abs(result.expected_difference()) < 1e-3
    assert abs(result.difference()) < PRINTED_DIFFERENCE


def test_cross_sections_grow_and_are_hertzian(result: Result) -> None:
    middle = np.abs(result.row_mm) < 0.1
    assert (np.diff(result.rows[:, middle].mean(axis=1)) > -2.0).all(), "the middle brightens within its noise"
    assert result.misfit(half_ellipse) < 0.03
    assert result.misfit(gaussian) > 2 * result.misfit(half_ellipse)
    assert result.rows.max() < SENSOR.full_scale - SENSOR.background_grey, "nothing clips"


def test_small_and_large_strain_meet_at_light_presses(result: Result) -> None:
    """Two models, each with its own mesh, where the tip of 2 mm is not yet deep; the coarse one is good for 3 %."""
    for place in (3, 5, 7):
        other = indent(PROBE, sphere_radius_mm=2.0, force_n=float(FORCES_N[place])).contact_radius_mm
        assert result.contact_mm[2.0][place] == pytest.approx(other, rel=0.03)


def test_the_width_is_that_of_a_half_ellipse(result: Result) -> None:
    """Half of the height is reached at ``sqrt(3) / 2`` of the contact radius."""
    expected = np.sqrt(3) * result.contact_mm[2.0][-1]
    assert row_values(result)["width at half height at 2 N"] == pytest.approx(expected, abs=0.1)


def test_the_figures_and_the_table_show_what_was_found(result: Result, capsys: pytest.CaptureFixture[str]) -> None:
    figures = {shown.name: Figure() for shown in SHOWN}
    for shown in SHOWN:
        assert shown.draw is not None
        shown.draw(result, figures[shown.name])
    assert np.asarray(figures["figure-5-2"].axes[0].lines[-1].get_ydata()) == pytest.approx(result.rows[-1])
    up = figures["figure-5-3"].axes[0].lines[0]
    assert np.asarray(up.get_ydata()) == pytest.approx(result.sums[2.0][0] / 1e6)
    apart = np.asarray(figures["figure-5-4"].axes[1].lines[0].get_ydata())
    assert apart[7] == pytest.approx(100 * result.difference())
    report(result)
    assert "14 mm over 10 mm at 0.8 N" in capsys.readouterr().out


def test_the_tip_of_2_mm_does_not_depend_on_the_mesh() -> None:
    finer = contact_radii(SphereResolution(order=4, cells=13, rings=2, face_cells=12))
    np.testing.assert_allclose(contact_radii(FINE)[2.0], finer[2.0], rtol=0.005)
