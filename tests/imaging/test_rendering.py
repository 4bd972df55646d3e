"""From press to light: closed forms of the response, contact models against counted rays, light maps, losses."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from tsis.errors import InputError
from tsis.imaging.rendering import (
    CurvatureLoss,
    RoughContact,
    SmoothContact,
    as_contact_model,
    contact_edges,
    coverage,
    find_lost_light,
    render,
    render_reference,
    rough_contact,
    rough_contact_slope,
)
from tsis.imaging.sensor import Sensor
from tsis.model.calibration import Calibration, LightMap
from tsis.model.press import PressField
from tsis.optics.angles import ERF_SLOPE

ANSWER = Calibration(gain_grey_per_kpa=50.0, saturation_kpa=20.0)
FINE = Sensor(columns=400, rows=300, mm_per_pixel=(0.02, 0.03))


def hertz_field(force_mn: float, radius_mm: float = 2.0) -> PressField:
    """Half-ellipsoid of pressure on a contact of ``radius_mm`` that carries ``force_mn``."""
    radius = np.linspace(0.0, radius_mm, 2001)
    peak = 1.5 * force_mn / (np.pi * radius_mm**2)
    return PressField(
        radius_mm=radius,
        pressure_kpa=peak * np.sqrt(1 - (radius / radius_mm) ** 2),
        face_displacement_mm=0 * radius,
        approach_mm=0.0,
        force_n=force_mn / 1000,
    )


@given(pressure=st.floats(0.0, 200.0))
def test_response_is_the_integral_of_a_bell(pressure: float) -> None:
    """erf by its definition, computed by quadrature."""
    share, _ = quad(lambda t: 2 / np.sqrt(np.pi) * np.exp(-(t**2)), 0.0, ERF_SLOPE * pressure / 20.0)
    assert float(rough_contact(np.array(pressure), ANSWER)) == pytest.approx(1000.0 * share, rel=1e-9, abs=1e-9)
    assert pytest.approx(0.886, abs=5e-4) == ERF_SLOPE


def test_response_grows_saturates_and_ignores_suction() -> None:
    grey = rough_contact(np.array([-5.0, 0.0, 1.0, 10.0, 100.0, 1e4]), ANSWER)
    assert grey[:2].tolist() == [0.0, 0.0]
    assert (np.diff(grey[1:]) >= 0).all()
    assert grey[2] == pytest.approx(50.0, rel=1e-3)
    assert grey[-1] == 1000.0


@given(pressure=st.floats(0.0, 60.0))
def test_slope_is_the_derivative(pressure: float) -> None:
    step = 1e-4
    ends = rough_contact(np.array([pressure, pressure + 2 * step]), ANSWER)
    slope = rough_contact_slope(np.array([pressure + step]), ANSWER)[0]
    assert slope == pytest.approx((ends[1] - ends[0]) / (2 * step), rel=1e-4, abs=1e-6)
    assert rough_contact_slope(np.array([-1.0]), ANSWER)[0] == 0.0


@pytest.mark.parametrize("blur_mm", [0.0, 0.05])
def test_sum_of_light_is_proportional_to_the_force_at_small_pressure(blur_mm: float) -> None:
    area = FINE.mm_per_pixel[0] * FINE.mm_per_pixel[1]
    forces = np.array([0.01, 0.1, 1.0, 3.0])
    sums = [render(hertz_field(force), FINE, ANSWER, blur_mm=blur_mm).sum() * area for force in forces]
    np.testing.assert_allclose(sums, 50.0 * forces, rtol=2e-3)


def test_saturation_breaks_the_proportion() -> None:
    weak, strong = (render(hertz_field(force), FINE, ANSWER).sum() for force in (1.0, 1000.0))
    assert strong < 900 * weak


def test_an_unblurred_picture_is_the_profile_itself() -> None:
    field = hertz_field(20.0)
    light = render(field, FINE, ANSWER, blur_mm=0.0)
    assert light.shape == (300, 400)
    distance = FINE.radius_mm()
    peak = field.pressure_kpa[0]
    exact = rough_contact(peak * np.sqrt(np.maximum(1 - (distance / 2.0) ** 2, 0.0)), ANSWER)
    np.testing.assert_allclose(light, exact, atol=0.02 * exact.max())
    assert not light[distance > 2.0].any()
    assert np.abs(light - exact)[distance < 1.9].max() < 1e-4 * exact.max()


@pytest.mark.parametrize("axis", [0, 1])
def test_blur_spreads_a_step_by_its_standard_deviation(axis: int) -> None:
    """An edge becomes the normal distribution's curve, as wide in mm in both directions."""
    radius = np.linspace(0.0, 3.0, 3001)
    flat = PressField(
        radius_mm=radius,
        pressure_kpa=np.where(radius <= 2.5, 1.0, 0.0),
        face_displacement_mm=0 * radius,
        approach_mm=0.0,
        force_n=1.0,
    )
    light = render(flat, FINE, ANSWER, blur_mm=0.2)
    row = light.take(light.shape[1 - axis] // 2, axis=1 - axis)[light.shape[axis] // 2 :]
    edge = -np.gradient(row)
    x = np.arange(len(row)) * FINE.mm_per_pixel[1 - axis]
    near = (x > 1.5) & (x < 3.5)
    centre = (edge * x)[near].sum() / edge[near].sum()
    width = np.sqrt((edge * (x - centre) ** 2)[near].sum() / edge[near].sum())
    assert width == pytest.approx(0.2, rel=0.03)


@pytest.mark.parametrize("blur_mm", [-0.1, float("nan"), 11.0])
def test_a_blur_without_meaning_is_refused(blur_mm: Any) -> None:
    with pytest.raises(InputError, match="blur_mm must lie in"):
        render(hertz_field(1.0), FINE, ANSWER, blur_mm=blur_mm)


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


FACE = Sensor(columns=400, rows=300, mm_per_pixel=(0.02, 0.03))


def share_of(model: Any, *, pressure: float = 1.0, slope: float = 0.0) -> float:
    return float(model.light_fraction(np.array([pressure]), slope=np.array([slope]), saturation_kpa=20.0)[0])


def round_field(pressure: Any, radius_mm: float = 3.0) -> PressField:
    radius = np.linspace(0.0, radius_mm, 301)
    return PressField(
        radius_mm=radius,
        pressure_kpa=pressure(radius),
        face_displacement_mm=0 * radius,
        approach_mm=0.0,
        force_n=1.0,
    )


def counted_share(index: float, slope: float) -> float:
    """Rays of a Lambertian flux on the tilted face, counted when guided by the flat face and let out by the tilted."""
    rng, rays, tilt = np.random.default_rng(4), 1_000_000, np.arctan(slope)
    sine, azimuth = np.sqrt(rng.random(rays)), 2 * np.pi * rng.random(rays)
    to_flat = np.sqrt(1 - sine**2) * np.cos(tilt) - sine * np.sin(tilt) * np.cos(azimuth)
    critical = np.sqrt(1 - 1 / index**2)
    return float(np.mean((sine < 1 / index) & (to_flat < critical)) / critical**2)


@pytest.mark.parametrize("index", [1.16, 1.41, 2.0])
@pytest.mark.parametrize("slope", [0.1, 0.5, 1.5])
def test_what_curvature_lets_out_is_what_is_counted(index: float, slope: float) -> None:
    counted = min(counted_share(index, slope), 1.0)
    deviation = np.sqrt(counted / 1e6) / (1 - 1 / index**2)
    assert share_of(CurvatureLoss(refractive_index=index), slope=slope) == pytest.approx(counted, abs=5 * deviation)


@given(index=st.floats(1.05, 3.9), slope=st.floats(1e-6, 1e-3))
def test_a_gentle_slope_lets_out_in_proportion(index: float, slope: float) -> None:
    expected = 2 / np.pi / np.sqrt(index**2 - 1) * slope  # tan(critical) = 1 / sqrt(n**2 - 1)
    assert share_of(CurvatureLoss(refractive_index=index), slope=slope) == pytest.approx(expected, rel=0.01)


@given(index=st.floats(1.01, 4.0), slope=st.floats(0.0, 1e3), steeper=st.floats(1.0, 2.0))
def test_a_steeper_slope_lets_out_more_whatever_its_sign(index: float, slope: float, steeper: float) -> None:
    model = CurvatureLoss(refractive_index=index)
    assert 0.0 <= share_of(model, slope=slope) <= share_of(model, slope=steeper * slope) + 1e-12 <= 1.0 + 1e-12
    assert share_of(model, slope=-slope) == share_of(model, slope=slope)


def test_only_the_quantity_of_its_model_matters() -> None:
    assert share_of(RoughContact(), pressure=3.0, slope=0.0) == share_of(RoughContact(), pressure=3.0, slope=1.0) > 0
    assert share_of(SmoothContact(), pressure=3.0) == share_of(SmoothContact(), pressure=1e-6) == 1.0
    assert share_of(SmoothContact(), pressure=0.0, slope=1.0) == 0.0
    assert share_of(CurvatureLoss(), pressure=3.0, slope=0.2) == share_of(CurvatureLoss(), pressure=0.0, slope=0.2) > 0


def test_the_rough_share_is_the_grey_level_over_that_of_full_contact() -> None:
    answer = Calibration(gain_grey_per_kpa=50.0, saturation_kpa=20.0)
    pressure = np.linspace(-1.0, 80.0, 50)
    share = RoughContact().light_fraction(pressure, slope=0 * pressure, saturation_kpa=20.0)
    np.testing.assert_allclose(rough_contact(pressure, answer), 1000.0 * share, rtol=1e-14)


@pytest.mark.parametrize(
    ("model", "phrase"),
    [
        ("ruogh", r"no contact_model is called 'ruogh'; did you mean 'rough'\?"),
        (3.0, "contact_model must be one of rough, smooth, curvature or a model; got 3.0"),
        (None, "contact_model must be one of"),
    ],
)
def test_what_is_no_contact_model(model: Any, phrase: str) -> None:
    with pytest.raises(InputError, match=phrase):
        as_contact_model(model)


@pytest.mark.parametrize("index", [1.0, float("nan"), 5.0])
def test_an_index_that_guides_nothing_is_refused(index: float) -> None:
    with pytest.raises(InputError, match=r"refractive_index must lie in \[1.01, 4\]"):
        CurvatureLoss(refractive_index=index)


@given(edge=st.floats(0.2, 2.9))
def test_the_edge_of_a_sphere_is_found_between_the_radii(edge: float) -> None:
    field = round_field(lambda radius: np.sqrt(np.maximum(1 - (radius / edge) ** 2, 0.0)))
    ((found, side),) = contact_edges(field)
    assert side == 1
    assert found == pytest.approx(edge, abs=3e-3), "the radii are 10 um apart"


@given(edge=st.floats(0.2, 2.9))
def test_a_covered_disc_has_the_area_of_its_circle(edge: float) -> None:
    field = round_field(lambda radius: np.sqrt(np.maximum(1 - (radius / edge) ** 2, 0.0)))
    area = coverage(field, FACE).sum() * FACE.mm_per_pixel[0] * FACE.mm_per_pixel[1]
    ((found, _),) = contact_edges(field)
    assert area == pytest.approx(np.pi * found**2, rel=2e-3)


def test_coverage_is_that_of_pixels_cut_into_pieces() -> None:
    field = round_field(lambda radius: np.sqrt(np.maximum(1 - (radius / 1.7) ** 2, 0.0)))
    fine = Sensor(columns=20 * 400, rows=20 * 300, mm_per_pixel=(0.001, 0.0015))
    ((edge, _),) = contact_edges(field)
    x, y = fine.axes_mm()
    pieces = (np.hypot(x[None, :], y[:, None]) < edge).reshape(300, 20, 400, 20).mean(axis=(1, 3))
    off = np.abs(coverage(field, FACE) - pieces)
    assert off.max() < 0.13, "an edge across a corner"
    assert off[(pieces > 0) & (pieces < 1)].mean() < 0.04


def test_a_contact_with_a_hole_is_a_ring() -> None:
    field = round_field(lambda radius: np.where((radius > 0.995) & (radius < 2.005), 1.0, 0.0))
    assert [side for _, side in contact_edges(field)] == [-1, 1]
    assert [edge for edge, _ in contact_edges(field)] == pytest.approx([0.995, 2.005], abs=0.006)
    covered = coverage(field, FACE)
    distance = FACE.radius_mm()
    assert not covered[distance < 0.95].any()
    assert (covered[(distance > 1.05) & (distance < 1.95)] == 1.0).all()


def test_a_face_in_full_contact_ends_at_its_rim_and_none_has_no_edge() -> None:
    assert contact_edges(round_field(np.ones_like)) == [(3.0, 1)]
    assert contact_edges(round_field(np.zeros_like)) == []
    assert not coverage(round_field(np.zeros_like), FACE).any()
