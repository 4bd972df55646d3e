"""Rendering under traced light and by other contact models, against the formula as written and against closed forms."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tsis.errors import InputError
from tsis.imaging.corrections import find_lost_light
from tsis.imaging.rendering import CurvatureLoss, render, render_reference
from tsis.imaging.sensor import Sensor
from tsis.model.calibration import Calibration, LightMap
from tsis.model.press import PressField

ANSWER = Calibration(gain_grey_per_kpa=50.0, saturation_kpa=20.0)
SENSOR = Sensor(columns=200, rows=150, mm_per_pixel=(0.04, 0.05))
MODELS = ("rough", "smooth", "curvature")
KNOTS = np.linspace(-4.0, 4.0, 17)


def dented(edge_mm: float = 2.0, depth_mm: float = 0.5, face_mm: float = 5.0) -> PressField:
    """A Hertzian pressure in a bell-shaped dent."""
    radius = np.linspace(0.0, face_mm, 2001)
    return PressField(
        radius_mm=radius,
        pressure_kpa=15.0 * np.sqrt(np.maximum(1 - (radius / edge_mm) ** 2, 0.0)),
        face_displacement_mm=depth_mm * np.exp(-((radius / edge_mm) ** 2)),
        approach_mm=depth_mm,
        force_n=2 / 3 * np.pi * edge_mm**2 * 15.0 / 1000,
    )


def light_map(**changes: Any) -> LightMap:
    """Even light with some fields changed."""
    even = np.ones((len(KNOTS), len(KNOTS)))
    given: dict[str, Any] = {
        "relative": even,
        "flux_x": 0 * even,
        "flux_y": 0 * even,
        "growth_per_mm": 0 * even,
        "error": 0.0,
    }
    return LightMap(x_mm=KNOTS, y_mm=KNOTS, **given | changes)


def uneven_light(seed: int = 3) -> LightMap:
    """Light without any symmetry."""
    rng = np.random.default_rng(seed)
    shape = (len(KNOTS), len(KNOTS))
    flux_x, flux_y = 0.5 * rng.standard_normal((2, *shape))
    relative = 0.5 + rng.random(shape)
    return light_map(relative=relative, flux_x=flux_x, flux_y=flux_y, growth_per_mm=rng.standard_normal(shape))


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("blur_mm", [0.0, 0.1])
@pytest.mark.parametrize("light", [None, uneven_light()], ids=["even", "uneven"])
def test_the_fast_picture_is_the_formula_as_written(model: str, blur_mm: float, light: LightMap | None) -> None:
    sensor = replace(SENSOR, field_angle_deg=20.0)
    fast, plain = (
        draw(dented(), sensor, ANSWER, blur_mm=blur_mm, contact_model=model, light=light)
        for draw in (render, render_reference)
    )
    assert np.abs(fast - plain).max() < 1e-4 * plain.max(), "of radii 2.5 um apart"
    assert fast.sum() == pytest.approx(plain.sum(), rel=1e-6)


@given(seed=st.integers(0, 1000), columns=st.integers(8, 60), rows=st.integers(8, 60))
@settings(max_examples=20)
def test_so_it_is_on_any_sensor_under_any_light(seed: int, columns: int, rows: int) -> None:
    sensor = Sensor(columns=columns, rows=rows, mm_per_pixel=(0.2, 0.13))
    fast, plain = (
        draw(dented(), sensor, ANSWER, contact_model="curvature", light=uneven_light(seed))
        for draw in (render, render_reference)
    )
    assert np.abs(fast - plain).max() <= 1e-4 * plain.max()


def test_a_frame_of_even_light_is_the_frame_without_a_map() -> None:
    np.testing.assert_array_equal(
        render(dented(), SENSOR, ANSWER), render(dented(), SENSOR, ANSWER, light=LightMap.uniform())
    )


def test_light_that_grows_sideways_multiplies_the_picture() -> None:
    ramp = render(
        dented(), SENSOR, ANSWER, blur_mm=0.0, light=light_map(relative=1 + KNOTS[None, :] / 8 + 0 * KNOTS[:, None])
    )
    even = render(dented(), SENSOR, ANSWER, blur_mm=0.0)
    x, _ = SENSOR.axes_mm()
    np.testing.assert_allclose(ramp, even * (1 + x / 8), rtol=1e-12)


def test_a_deeper_face_gets_exponentially_more_light() -> None:
    deep = render(
        dented(), SENSOR, ANSWER, blur_mm=0.0, light=light_map(growth_per_mm=np.full((len(KNOTS), len(KNOTS)), 0.8))
    )
    even = render(dented(), SENSOR, ANSWER, blur_mm=0.0)
    lit = SENSOR.radius_mm() < 1.9  # at the edge itself the profile's radii are too coarse for ratios
    depth = 0.5 * np.exp(-((SENSOR.radius_mm() / 2.0) ** 2))
    np.testing.assert_allclose(deep[lit] / even[lit], np.exp(0.8 * depth)[lit], rtol=1e-4)


def test_light_along_x_falls_on_the_side_of_the_dent_that_rises_along_x() -> None:
    """The dent rises towards the glass towards its middle, so its left flank rises along x."""
    flux = np.full((len(KNOTS), len(KNOTS)), 0.5)
    lit = render(dented(), SENSOR, ANSWER, blur_mm=0.0, light=light_map(flux_x=flux))
    even = render(dented(), SENSOR, ANSWER, blur_mm=0.0)
    middle = SENSOR.columns // 2
    assert lit[:, :middle].sum() > 1.02 * even[:, :middle].sum()
    np.testing.assert_allclose(lit - even, -(lit - even)[:, ::-1], atol=1e-9)
    turned = render(dented(), SENSOR, ANSWER, blur_mm=0.0, light=light_map(flux_y=flux))
    assert turned[: SENSOR.rows // 2].sum() > 1.02 * even[: SENSOR.rows // 2].sum()


def test_a_face_turned_away_from_all_light_is_dark() -> None:
    flux = np.full((len(KNOTS), len(KNOTS)), 20.0)
    lit = render(dented(), SENSOR, ANSWER, blur_mm=0.0, light=light_map(flux_x=flux))
    assert lit.min() == 0.0
    assert not lit[70:80, 130:135].any()


def test_smooth_contact_sums_to_its_area_and_rough_to_its_force() -> None:
    pixel = SENSOR.mm_per_pixel[0] * SENSOR.mm_per_pixel[1]
    for edge in (1.0, 2.0, 2.9):
        smooth = render(dented(edge), SENSOR, ANSWER, contact_model="smooth").sum() * pixel
        assert smooth == pytest.approx(1000.0 * np.pi * edge**2, rel=2e-3)
    gentle = replace(ANSWER, saturation_kpa=1e4)
    rough = render(dented(), SENSOR, gentle).sum() * pixel
    assert rough == pytest.approx(50.0 * 1000 * dented().force_n, rel=1e-3)


def test_curvature_is_dark_in_the_middle_and_shines_beyond_the_contact() -> None:
    picture = render(dented(), SENSOR, ANSWER, blur_mm=0.0, contact_model=CurvatureLoss(refractive_index=1.5))
    row = picture[SENSOR.rows // 2, SENSOR.columns // 2 :]
    x = SENSOR.axes_mm()[0][SENSOR.columns // 2 :]
    assert row[0] < 0.05 * row.max()
    assert x[row.argmax()] == pytest.approx(2.0 / np.sqrt(2), abs=0.1), "where the bell is steepest"
    assert row[x > 2.1].max() > 0.5 * row.max()


def test_the_rim_of_a_face_that_has_moved_is_no_slope() -> None:
    grid = np.linspace(-5.0, 5.0, 401)
    moved = replace(dented(face_mm=3.0), face_displacement_mm=np.full(2001, 0.7)).on_grid(grid, grid)
    assert render(moved, SENSOR, ANSWER, contact_model="curvature").max() < 1e-9


@pytest.mark.parametrize("model", [pytest.param("rough", marks=pytest.mark.slow), "curvature"])
def test_a_press_over_a_grid_renders_as_the_round_press_it_is(model: str) -> None:
    one = render(dented(), SENSOR, ANSWER, contact_model=model, light=uneven_light())
    off = []
    for nodes in (201, 401, 801):
        grid = np.linspace(-5.0, 5.0, nodes)
        other = render(dented().on_grid(grid, grid), SENSOR, ANSWER, contact_model=model, light=uneven_light())
        off.append(np.abs(one - other).mean() / one.mean())
        assert other.sum() == pytest.approx(one.sum(), rel=2e-3)
    assert off[2] < 0.6 * off[1] < 0.36 * off[0], "the grid's error goes as its spacing or better"
    assert off[2] < 1e-3


def test_the_lens_darkens_after_the_blur() -> None:
    straight = render(dented(), SENSOR, ANSWER, blur_mm=0.1)
    oblique = replace(SENSOR, field_angle_deg=30.0)
    np.testing.assert_allclose(
        render(dented(), oblique, ANSWER, blur_mm=0.1), straight * oblique.vignetting(), rtol=1e-12
    )


@pytest.mark.parametrize("half_width_mm", [0.5, 1.0, 1.7])
def test_what_a_narrow_frame_crops_is_integrated_in_closed_form(half_width_mm: float) -> None:
    """Half-ellipsoid of pressure cut by two parallel lines: a fraction (3 t - t**3) / 2 lies between them."""
    pixel = 2 * half_width_mm / 100
    narrow = Sensor(columns=100, rows=400, mm_per_pixel=(pixel, 0.05))
    lost = find_lost_light(dented(), narrow, replace(ANSWER, saturation_kpa=1e4))
    part = half_width_mm / 2.0
    # A section of the half-ellipsoid at x has the area pi / 2 b**2 / a, b**2 = a**2 - x**2.
    expected = 1 - (3 * part - part**3) / 2
    assert lost.force_outside == pytest.approx(expected, abs=2e-3)
    assert lost.light_outside == pytest.approx(expected, abs=2e-3)
    # What exceeds full scale lies in a disc, of which the frame, 20 mm high, shows the part between the lines.
    edge = 2.0 * np.sqrt(1 - ((255 - 8) / (50.0 * 15.0)) ** 2)
    shown = 2 * (half_width_mm * np.sqrt(edge**2 - half_width_mm**2) + edge**2 * np.arcsin(half_width_mm / edge))
    assert lost.pixels_clipped == pytest.approx(shown / (2 * half_width_mm * 20.0), rel=0.01)


def test_clipping_counts_pixels_and_light_above_full_scale() -> None:
    sensor = replace(SENSOR, background_grey=8.0)
    bright = replace(ANSWER, gain_grey_per_kpa=100.0)
    lost = find_lost_light(dented(), sensor, bright, contact_model="smooth", blur_mm=0.0)
    area = np.pi * 2.0**2 / (SENSOR.columns * SENSOR.rows * 0.04 * 0.05)
    assert lost.pixels_clipped == pytest.approx(area, rel=0.02)
    assert lost.light_clipped == pytest.approx(1 - (255 - 8) / 2000, rel=0.01)
    assert lost.force_outside == 0.0


def test_nothing_is_lost_without_contact() -> None:
    silent = replace(dented(), pressure_kpa=0 * dented().radius_mm)
    lost = find_lost_light(silent, SENSOR, ANSWER)
    assert (lost.force_outside, lost.light_outside, lost.pixels_clipped, lost.light_clipped) == (0.0, 0.0, 0.0, 0.0)


def test_light_that_is_none_is_refused() -> None:
    with pytest.raises(InputError, match=r"light must be a LightMap; got 3\.0"):
        render(dented(), SENSOR, ANSWER, light=3.0)  # type: ignore[arg-type]


def test_a_model_that_nobody_knows_is_refused() -> None:
    with pytest.raises(InputError, match="no contact_model is called 'shiny'"):
        render(dented(), SENSOR, ANSWER, contact_model="shiny")
