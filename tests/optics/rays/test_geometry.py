"""Faces under known presses: forces are integrals of pressures, displacements those of Hertz."""

from __future__ import annotations

import numpy as np
import pytest

from tsis.optics.rays.geometry import evenly_pressed_face, evenly_raised_face, hertz_dent, tip_press


def test_an_even_pressure_carries_its_force() -> None:
    field = evenly_pressed_face(12.0, 5.0)
    assert field.force_n == pytest.approx(5e3 * np.pi * 0.012**2)  # Pa times m^2
    np.testing.assert_array_equal(field.pressure_kpa, 5.0)
    assert not field.face_displacement_mm.any()
    assert field.radius_mm[-1] == 12.0
    raised = evenly_raised_face(12.0, 0.3)
    assert (raised.force_n, raised.approach_mm) == (0.0, 0.3)


def test_a_tips_pressure_carries_its_force() -> None:
    """The pressure is half an ellipsoid over the contact, and its integral over the face is the force."""
    radius = np.linspace(0.0, 12.0, 20_001)
    field = tip_press(radius, 1 - radius / 24, contact_radius_mm=3.0, force_n=0.4)
    height = np.sqrt(1 - np.minimum(radius / 3.0, 1.0) ** 2)
    np.testing.assert_allclose(field.pressure_kpa, field.pressure_kpa[0] * height, atol=1e-9)
    around = 2 * np.pi * radius * field.pressure_kpa
    assert float(np.trapezoid(around, radius)) == pytest.approx(400.0, rel=1e-5)  # mN
    assert field.approach_mm == 1.0


@pytest.mark.parametrize(("tip", "contact"), [(8.0, 2.0), (4.5, 1.5)])
def test_a_dent_carries_its_force_about_the_axis_and_has_hertzs_shape(tip: float, contact: float) -> None:
    dent = hertz_dent(12.0, tip_radius_mm=tip, depth_mm=0.5, peak_pressure_kpa=25.0)  # contact^2 is tip times depth
    step = float(dent.x_mm[1] - dent.x_mm[0])
    assert dent.force_n == pytest.approx(2 / 3 * 25e3 * np.pi * (contact / 1000) ** 2)
    assert dent.pressure_kpa.sum() * step**2 == pytest.approx(1000 * dent.force_n, rel=0.02)
    np.testing.assert_allclose(dent.face_displacement_mm, dent.face_displacement_mm[::-1, ::-1], atol=1e-12)
    np.testing.assert_allclose(dent.face_displacement_mm, dent.face_displacement_mm.T, atol=1e-12)
    radius = np.hypot(dent.x_mm, dent.y_mm[:, None])
    inside = radius < contact
    np.testing.assert_allclose(dent.face_displacement_mm[inside], 0.5 - radius[inside] ** 2 / (2 * tip), atol=1e-12)
    # Far away it is the displacement of a point force: 4 a^3 / (3 pi R r), to (a / r)^2.
    far = radius > 5 * contact
    point = 4 * contact**3 / (3 * np.pi * tip * radius[far])
    np.testing.assert_allclose(dent.face_displacement_mm[far], point, rtol=0.01)
    edge = np.abs(radius - contact) < step
    assert np.abs(dent.face_displacement_mm[edge] - 0.25).max() < 0.25 * step + 0.02
