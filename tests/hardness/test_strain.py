"""Strain of maps whose strain is known: stretches, rotations, shears, and splines that reproduce them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tsis.errors import InputError
from tsis.hardness.strain_map import axial_strain, lagrangian_strain, printed_axial_strain
from tsis.matching.spline import fit_spline

ANGLES = st.floats(-3.0, 3.0)
STRETCHES = st.floats(0.2, 3.0)


@given(x=STRETCHES, y=STRETCHES, z=STRETCHES)
def test_a_stretch_gives_half_of_the_change_of_its_square(x: float, y: float, z: float) -> None:
    gradient = np.diag([x, y, z])[None]
    expected = (np.array([x, y, z]) ** 2 - 1) / 2
    np.testing.assert_allclose(lagrangian_strain(gradient)[0], np.diag(expected), atol=1e-12)
    np.testing.assert_allclose(axial_strain(gradient), expected[2], atol=1e-12)


@given(a=ANGLES, b=ANGLES, c=ANGLES, z=STRETCHES)
def test_turning_a_body_strains_nothing_and_changes_no_strain(a: float, b: float, c: float, z: float) -> None:
    turn = Rotation.from_rotvec([a, b, c]).as_matrix()
    np.testing.assert_allclose(lagrangian_strain(turn[None]), 0.0, atol=1e-12)
    stretched = np.diag([1.0, 1.0, z])
    np.testing.assert_allclose(
        lagrangian_strain((turn @ stretched)[None]), lagrangian_strain(stretched[None]), atol=1e-11
    )


@given(shear=st.floats(-2.0, 2.0))
def test_simple_shear(shear: float) -> None:
    """``f_x = x + k z``: planes z = constant slide, e_xz = k / 2 and e_zz = k**2 / 2."""
    gradient = np.eye(3)[None].copy()
    gradient[0, 0, 2] = shear
    expected = np.zeros((3, 3))
    expected[0, 2] = expected[2, 0] = shear / 2
    expected[2, 2] = shear**2 / 2
    np.testing.assert_allclose(lagrangian_strain(gradient)[0], expected, atol=1e-12)
    np.testing.assert_allclose(axial_strain(gradient), shear**2 / 2, atol=1e-12)


def test_the_component_is_that_of_the_tensor() -> None:
    gradient = np.random.default_rng(5).normal(size=(50, 3, 3))
    tensor = lagrangian_strain(gradient)
    np.testing.assert_allclose(axial_strain(gradient), tensor[:, 2, 2], atol=1e-12)
    np.testing.assert_allclose(tensor, (np.swapaxes(gradient, 1, 2) @ gradient - np.eye(3)) / 2, atol=1e-12)


def test_the_printed_formula_strains_what_nobody_touched() -> None:
    assert printed_axial_strain(np.eye(3)[None])[0] == 1.5
    assert axial_strain(np.eye(3)[None])[0] == 0.0
    assert printed_axial_strain(np.diag([1.0, 1.0, 0.9])[None])[0] == pytest.approx(0.9 + 0.9**3 / 2)


def test_a_spline_through_a_uniform_compression_knows_its_strain() -> None:
    points = np.random.default_rng(1).normal(size=(60, 3))
    spline = fit_spline(points, points * [1.02, 1.02, 0.9])
    strain = axial_strain(spline.gradient(np.random.default_rng(2).normal(size=(20, 3))))
    np.testing.assert_allclose(strain, (0.9**2 - 1) / 2, atol=1e-8)


def test_a_spline_through_a_bent_body_gives_the_strain_between_its_points() -> None:
    """``f_z = z + 0.1 z**2 / 2`` has ``e_zz = 0.1 z + (0.1 z)**2 / 2``."""
    points = np.random.default_rng(3).uniform(-1, 1, size=(1500, 3))
    targets = points + np.column_stack([np.zeros((1500, 2)), 0.05 * points[:, 2] ** 2])
    inside = np.random.default_rng(4).uniform(-0.5, 0.5, size=(50, 3))
    strain = axial_strain(fit_spline(points, targets, control=points).gradient(inside))
    np.testing.assert_allclose(strain, 0.1 * inside[:, 2] + (0.1 * inside[:, 2]) ** 2 / 2, atol=4e-3)


@pytest.mark.parametrize("gradient", [np.eye(3), np.ones((2, 3, 2)), np.full((1, 3, 3), np.nan)])
def test_what_is_no_gradient_is_refused(gradient: np.ndarray) -> None:
    with pytest.raises(InputError, match="gradient must"):
        axial_strain(gradient)
