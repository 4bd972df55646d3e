"""The neo-Hookean material against closed forms, differences, and what every material must obey."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.optimize import brentq

from tsis.mechanics.finite_strain import neo_hookean
from tsis.mechanics.mesh import lame_constants

if TYPE_CHECKING:
    from numpy.typing import NDArray

MU, LAM = (float(value) for value in lame_constants(np.array(5.0), np.array(0.49)))


def some_gradients(count: int = 20) -> NDArray[np.float64]:
    rng = np.random.default_rng(7)
    return np.array([1.0, 0.0, 0.0, 1.0, 1.0])[:, None] + rng.uniform(-0.3, 0.3, (5, count))


def in_plane(gradient: NDArray[np.float64]) -> NDArray[np.float64]:
    """The in-plane 2 x 2 matrices, shape (count, 2, 2)."""
    return np.moveaxis(gradient[:4].reshape(2, 2, -1), -1, 0)


def test_lame_constants_are_those_of_small_strain() -> None:
    mu, lam = lame_constants(np.array([5.0]), np.array([0.25]))
    assert (mu[0], lam[0]) == pytest.approx((2.0, 2.0))


def test_the_stress_is_the_derivative_of_the_energy() -> None:
    gradient, step = some_gradients(), 1e-6
    stress = neo_hookean.stress(gradient, np.array(MU), np.array(LAM))
    for i in range(5):
        shift = step * np.eye(5)[i][:, None]
        above, below = (neo_hookean.energy(gradient + sign * shift, np.array(MU), np.array(LAM)) for sign in (1, -1))
        np.testing.assert_allclose((above - below) / (2 * step), stress[i], rtol=1e-6, atol=1e-6)


def test_the_tangent_is_the_derivative_of_the_stress_and_symmetric() -> None:
    gradient, step = some_gradients(), 1e-6
    tangent = neo_hookean.elasticity(gradient, np.array(MU), np.array(LAM))
    np.testing.assert_allclose(tangent, np.swapaxes(tangent, 0, 1), rtol=1e-13, atol=1e-12)
    for i in range(5):
        shift = step * np.eye(5)[i][:, None]
        above, below = (neo_hookean.stress(gradient + sign * shift, np.array(MU), np.array(LAM)) for sign in (1, -1))
        np.testing.assert_allclose((above - below) / (2 * step), tangent[:, i], rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("angle", [0.3, 1.7, 3.0])
def test_a_rotation_leaves_the_energy_and_turns_the_stress(angle: float) -> None:
    gradient = some_gradients()
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    turned = gradient.copy()
    turned[:4] = np.moveaxis(turn @ in_plane(gradient), 0, -1).reshape(4, -1)
    mu, lam = np.array(MU), np.array(LAM)
    np.testing.assert_allclose(
        neo_hookean.energy(turned, mu, lam), neo_hookean.energy(gradient, mu, lam), rtol=1e-12, atol=1e-12
    )
    before, after = neo_hookean.stress(gradient, mu, lam), neo_hookean.stress(turned, mu, lam)
    np.testing.assert_allclose(in_plane(after), turn @ in_plane(before), rtol=1e-12, atol=1e-11)
    np.testing.assert_allclose(after[4], before[4], rtol=1e-12)


def lateral_stretch(axial: float) -> float:
    """Stretch of the free sides of a bar: the lateral stress vanishes."""
    return float(
        brentq(
            lambda across: MU * (across - 1 / across) + LAM * np.log(axial * across**2) / across, 0.5, 2.0, xtol=1e-15
        )
    )


@pytest.mark.parametrize("axial", [0.5, 0.8, 1.2, 1.6])
def test_uniaxial_stress_is_the_closed_form(axial: float) -> None:
    across = lateral_stretch(axial)
    gradient = np.array([across, 0.0, 0.0, axial, across])[:, None]
    stress = neo_hookean.stress(gradient, np.array(MU), np.array(LAM))[:, 0]
    # With no lateral stress, lambda ln J = mu (1 - across^2): P = mu (axial - across^2 / axial).
    assert stress[3] == pytest.approx(MU * (axial - across**2 / axial), rel=1e-8)
    np.testing.assert_allclose(stress[[0, 1, 2, 4]], 0.0, atol=1e-12 * LAM)


def test_small_strains_give_hookes_law() -> None:
    strain = 1e-7
    gradient = np.array([1.0, 0.0, 0.0, 1 + strain, 1.0])[:, None]
    stress = neo_hookean.stress(gradient, np.array(MU), np.array(LAM))[:, 0]
    assert stress[3] / strain == pytest.approx(LAM + 2 * MU, rel=1e-6)
    assert stress[0] / strain == pytest.approx(LAM, rel=1e-6)


def test_matter_that_is_turned_over_has_no_finite_energy() -> None:
    gradient = np.array([[-1.0, 0, 0, 1, 1], [1, 0, 0, 1, -1], [-1, 0, 0, 1, -1]]).T
    assert np.all(np.isinf(neo_hookean.energy(gradient, np.array(MU), np.array(LAM))))


def test_principal_stretches_of_a_turned_stretch() -> None:
    angle, stretches = 0.4, (1.5, 0.7)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    plane = turn @ np.diag(stretches)
    found = neo_hookean.principal_stretches(np.array([*plane.ravel(), 0.95])[:, None])[:, 0]
    np.testing.assert_allclose(found, [1.5, 0.7, 0.95], rtol=1e-12)


def test_the_held_volumetric_stress_is_the_true_one_at_rest() -> None:
    gradient = some_gradients()
    mu, lam = np.array(MU), np.array(LAM)
    held = neo_hookean.volumetric_stress(gradient, lam)
    np.testing.assert_allclose(
        neo_hookean.elasticity(gradient, mu, lam, held), neo_hookean.elasticity(gradient, mu, lam), rtol=1e-13
    )
    step, change = 1e-7, some_gradients() - 1.0
    difference = neo_hookean.volumetric_stress(gradient + step * change, lam) - held
    found = neo_hookean.volumetric_stress_change(gradient, change, lam)
    np.testing.assert_allclose(difference / step, found, rtol=1e-4, atol=1e-3)
