"""Shares of light that leave: the tilted face against counted rays, a smooth contact against circles."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.errors import InputError
from tsis.imaging.rendering import (
    CurvatureLoss,
    RoughContact,
    SmoothContact,
    as_contact_model,
    contact_edges,
    coverage,
    rough_contact,
)
from tsis.imaging.sensor import Sensor
from tsis.model.calibration import Calibration
from tsis.model.press import PressField

SENSOR = Sensor(columns=400, rows=300, mm_per_pixel=(0.02, 0.03))


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
    area = coverage(field, SENSOR).sum() * SENSOR.mm_per_pixel[0] * SENSOR.mm_per_pixel[1]
    ((found, _),) = contact_edges(field)
    assert area == pytest.approx(np.pi * found**2, rel=2e-3)


def test_coverage_is_that_of_pixels_cut_into_pieces() -> None:
    field = round_field(lambda radius: np.sqrt(np.maximum(1 - (radius / 1.7) ** 2, 0.0)))
    fine = Sensor(columns=20 * 400, rows=20 * 300, mm_per_pixel=(0.001, 0.0015))
    ((edge, _),) = contact_edges(field)
    x, y = fine.axes_mm()
    pieces = (np.hypot(x[None, :], y[:, None]) < edge).reshape(300, 20, 400, 20).mean(axis=(1, 3))
    off = np.abs(coverage(field, SENSOR) - pieces)
    assert off.max() < 0.13, "an edge across a corner"
    assert off[(pieces > 0) & (pieces < 1)].mean() < 0.04


def test_a_contact_with_a_hole_is_a_ring() -> None:
    field = round_field(lambda radius: np.where((radius > 0.995) & (radius < 2.005), 1.0, 0.0))
    assert [side for _, side in contact_edges(field)] == [-1, 1]
    assert [edge for edge, _ in contact_edges(field)] == pytest.approx([0.995, 2.005], abs=0.006)
    covered = coverage(field, SENSOR)
    distance = SENSOR.radius_mm()
    assert not covered[distance < 0.95].any()
    assert (covered[(distance > 1.05) & (distance < 1.95)] == 1.0).all()


def test_a_face_in_full_contact_ends_at_its_rim_and_none_has_no_edge() -> None:
    assert contact_edges(round_field(np.ones_like)) == [(3.0, 1)]
    assert contact_edges(round_field(np.zeros_like)) == []
    assert not coverage(round_field(np.zeros_like), SENSOR).any()
