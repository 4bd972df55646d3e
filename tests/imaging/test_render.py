"""From pressure to light: closed forms of the response, the sum of light against the force, and the blur."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from tsis.errors import InputError
from tsis.imaging.rendering import render, rough_contact, rough_contact_slope
from tsis.imaging.sensor import Sensor
from tsis.model.calibration import Calibration
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
