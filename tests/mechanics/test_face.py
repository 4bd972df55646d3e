"""The face: interpolation and mass against polynomials and areas."""

from __future__ import annotations

import numpy as np
import pytest

from tsis.mechanics.small_strain.slab import Resolution, face_of

FACE = face_of(12.0, Resolution())


def test_nodes_run_from_the_axis_to_the_edge() -> None:
    assert (FACE.radius_mm[0], FACE.radius_mm[-1]) == (0.0, 12.0)
    assert (np.diff(FACE.radius_mm) > 0).all()
    smallest = np.diff(FACE.lines)[-1]
    assert smallest == np.diff(FACE.lines).min() <= 0.01 * 12.0


def test_interpolation_reproduces_polynomials_of_the_elements_order() -> None:
    radius = np.linspace(0.0, 12.0, 101)
    given = np.polynomial.Polynomial([1.0, -2.0, 0.3, 0.05, -0.004, 0.0003])
    np.testing.assert_allclose(FACE.interpolation(radius) @ given(FACE.radius_mm), given(radius), rtol=1e-10)


def test_interpolation_at_the_nodes_is_the_identity() -> None:
    np.testing.assert_allclose(FACE.interpolation(FACE.radius_mm), np.eye(len(FACE.radius_mm)), atol=1e-12)


def test_mass_turns_pressure_into_force() -> None:
    mass, radius = FACE.mass(), FACE.radius_mm
    np.testing.assert_allclose(mass, mass.T, atol=1e-12)
    assert mass.sum() == pytest.approx(np.pi * 144.0, rel=1e-12)
    # p = r**3 on the face, weighed by r**2: 2 pi r**6 integrated.
    assert radius**2 @ mass @ radius**3 == pytest.approx(2 * np.pi * 12.0**7 / 7, rel=1e-12)


def test_averages_keep_the_integral_and_what_is_constant() -> None:
    grid = np.linspace(0.0, 12.0, 241)
    matrix = FACE.averages(grid)
    np.testing.assert_allclose(matrix.sum(axis=1), 1.0, rtol=1e-12)
    singular = 1 / np.sqrt(12.3**2 - FACE.radius_mm**2)
    total = np.ones(len(FACE.radius_mm)) @ FACE.mass() @ singular
    assert 2 * np.pi * np.trapezoid(grid * (matrix @ singular), grid) == pytest.approx(total, rel=2e-4)
    # A hat of half-width h has the second moment h**2 / 6; the weight r makes it count three times for a parabola.
    np.testing.assert_allclose((matrix @ FACE.radius_mm**2 - grid**2)[40:-1], 3 * 0.05**2 / 6, rtol=0.01)
