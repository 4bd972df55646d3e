"""Elements: what each of them must reproduce exactly, whatever its shape and order."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.mechanics.closed_forms import oedometric_modulus_kpa

from tsis.mechanics.mesh import (
    Face,
    Spheroid,
    graded,
    hat_areas,
    lagrange,
    lame_constants,
    lobatto_points,
    mesh_around,
    mesh_inside,
    reference_element,
    refine,
    stiffness,
    two_sided_lines,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray


ORDERS = [1, 2, 3, 5, 6]
CORNERS = np.array([[1.0, 0.0], [1.3, 2.0], [3.0, -0.2], [2.8, 1.7]])  # no edge along an axis


def quadrilateral(order: int) -> NDArray[np.float64]:
    unit = (lobatto_points(order) + 1) / 2
    a, b = np.meshgrid(unit, unit, indexing="ij")
    corner = CORNERS.reshape(2, 2, 2)
    nodes = (
        ((1 - a) * (1 - b))[..., None] * corner[0, 0]
        + ((1 - a) * b)[..., None] * corner[0, 1]
        + (a * (1 - b))[..., None] * corner[1, 0]
        + (a * b)[..., None] * corner[1, 1]
    )
    return np.asarray(nodes.reshape(1, -1, 2), dtype=float)


def matrix(order: int, young: float = 5.0, poisson: float = 0.3) -> NDArray[np.float64]:
    matrices = stiffness(quadrilateral(order), order, np.array([young]), np.array([poisson]))
    return np.asarray(matrices[0], dtype=float)


def ring_volume() -> float:
    """Volume swept by the quadrilateral: 2 pi times the integral of r over its area, by Green's theorem."""
    loop = CORNERS[[0, 1, 3, 2]]
    r, z = loop.T
    next_r, next_z = np.roll(r, -1), np.roll(z, -1)
    return float(abs(np.pi / 3 * ((r**2 + r * next_r + next_r**2) * (next_z - z)).sum()))


@pytest.mark.parametrize("order", ORDERS)
def test_moving_along_the_axis_costs_nothing(order: int) -> None:
    found = matrix(order)
    rigid = np.tile([0.0, 1.0], (order + 1) ** 2)
    assert np.abs(found @ rigid).max() < 1e-11 * np.abs(found).max()


@pytest.mark.parametrize("order", ORDERS)
def test_symmetric_with_one_rigid_motion(order: int) -> None:
    found = matrix(order)
    np.testing.assert_allclose(found, found.T, atol=1e-11 * np.abs(found).max())
    values = np.linalg.eigvalsh(found)
    assert abs(values[0]) < 1e-10 * values[-1] < values[1]


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.49])
def test_energy_of_uniform_strain(order: int, poisson: float) -> None:
    """u_r = b r, u_z = c z: the energy is the density by Hooke's law times the volume."""
    nodes = quadrilateral(order)[0]
    sideways, along = 0.3, -0.7
    move = np.column_stack([sideways * nodes[:, 0], along * nodes[:, 1]]).ravel()
    shear, lame = 5.0 / (2 * (1 + poisson)), 5.0 * poisson / ((1 + poisson) * (1 - 2 * poisson))
    density = lame / 2 * (2 * sideways + along) ** 2 + shear * (2 * sideways**2 + along**2)
    energy = 0.5 * move @ matrix(order, poisson=poisson) @ move
    assert energy == pytest.approx(density * ring_volume(), rel=1e-11)


@pytest.mark.parametrize("order", ORDERS)
def test_energy_of_uniform_shear(order: int) -> None:
    nodes = quadrilateral(order)[0]
    move = np.column_stack([np.zeros(len(nodes)), 0.2 * nodes[:, 0]]).ravel()
    energy = 0.5 * move @ matrix(order) @ move
    assert energy == pytest.approx(0.5 * 5.0 / 2.6 * 0.2**2 * ring_volume(), rel=1e-11)


def test_either_orientation_gives_the_same_stiffness() -> None:
    order = 3
    turned = quadrilateral(order).reshape(order + 1, order + 1, 2).swapaxes(0, 1).reshape(1, -1, 2)
    mirrored = stiffness(turned, order, np.array([5.0]), np.array([0.3]))[0]
    place = np.arange(2 * (order + 1) ** 2).reshape(order + 1, order + 1, 2).swapaxes(0, 1).ravel()
    expected = matrix(order)[np.ix_(place, place)]
    np.testing.assert_allclose(mirrored, expected, atol=1e-12 * np.abs(expected).max())


def hooke(young: float, poisson: float) -> NDArray[np.float64]:
    """Stresses (rr, zz, hoop, rz) by strains, engineering shear."""
    shear, lame = (float(constant[0]) for constant in lame_constants(np.array([young]), np.array([poisson])))
    law = np.diag([2 * shear, 2 * shear, 2 * shear, shear])
    law[:3, :3] += lame
    return law


def test_hooke() -> None:
    law = hooke(7.0, 0.4)
    uniaxial = np.linalg.solve(law, [0.0, 1.0, 0.0, 0.0])
    np.testing.assert_allclose(uniaxial, np.array([-0.4, 1.0, -0.4, 0.0]) / 7.0, rtol=1e-12, atol=1e-15)
    assert law[1, 1] == pytest.approx(oedometric_modulus_kpa(young_kpa=7.0, poisson=0.4))
    assert law[3, 3] == pytest.approx(7.0 / 2.8)


@pytest.mark.parametrize("order", ORDERS)
def test_stiffness_is_the_sum_over_points_that_anyone_can_read(order: int) -> None:
    nodes, ref, law = quadrilateral(order)[0], reference_element(order), hooke(5.0, 0.3)
    total = np.zeros((2 * len(nodes), 2 * len(nodes)))
    for value, slope_a, slope_b, weight in zip(ref.value, ref.slope_a, ref.slope_b, ref.weight, strict=True):
        jacobian = np.array([slope_a @ nodes, slope_b @ nodes])
        along_r, along_z = np.linalg.solve(jacobian, [slope_a, slope_b])
        radius, nothing = value @ nodes[:, 0], np.zeros(len(nodes))
        rows = [(along_r, nothing), (nothing, along_z), (value / radius, nothing), (along_z, along_r)]
        strain = np.array([np.column_stack(row).ravel() for row in rows])
        total += 2 * np.pi * radius * abs(np.linalg.det(jacobian)) * weight * strain.T @ law @ strain
    np.testing.assert_allclose(matrix(order), total, atol=1e-12 * np.abs(total).max())


@pytest.mark.parametrize("order", ORDERS)
def test_lobatto_points_are_where_the_derivative_vanishes(order: int) -> None:
    points = lobatto_points(order)
    assert len(points) == order + 1
    assert (points[0], points[-1]) == (-1.0, 1.0)
    slope = np.polynomial.legendre.Legendre.basis(order).deriv()
    assert np.abs(slope(points[1:-1])).max(initial=0.0) < 1e-11
    np.testing.assert_allclose(points, -points[::-1], atol=1e-14)


@pytest.mark.parametrize("order", ORDERS)
def test_lagrange_reproduces_polynomials_and_slopes(order: int) -> None:
    x = np.linspace(-1.0, 1.0, 23)
    value, slope = lagrange(lobatto_points(order), x)
    given = np.polynomial.Polynomial(np.arange(1.0, order + 2))
    np.testing.assert_allclose(value @ given(lobatto_points(order)), given(x), rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(slope @ given(lobatto_points(order)), given.deriv()(x), rtol=1e-10, atol=1e-11)


def test_graded_lines_start_fine_and_fill_the_length() -> None:
    lines = graded(10.0, 0.1, 2.0, 3.0)
    steps = np.diff(lines)
    assert (lines[0], lines[-1]) == (0.0, 10.0)
    assert steps[0] <= 0.1
    assert steps.max() <= 3.0
    assert (steps[1:] >= steps[:-1] * (1 - 1e-12)).all()
    assert (steps[1:] <= steps[:-1] * (2 + 1e-12)).all()


def test_refined_lines_keep_the_lines() -> None:
    lines = np.array([0.0, 1.0, 4.0])
    nodes = refine(lines, 3)
    assert nodes[::3].tolist() == lines.tolist()
    assert (np.diff(nodes) > 0).all()


@pytest.mark.parametrize("order", ORDERS)
def test_the_face_reproduces_a_line_with_a_kink_at_each_boundary(order: int) -> None:
    lines, heights = np.array([0.0, 1.0, 2.5, 3.2, 4.0]), np.array([2.0, -1.0, 0.5, 3.0, -4.0])
    face = Face(lines=lines, order=order)
    radius = np.linspace(0.0, 4.0, 41)
    values = face.interpolation(radius) @ np.interp(face.radius_mm, lines, heights)
    np.testing.assert_allclose(values, np.interp(radius, lines, heights), atol=1e-12)


@pytest.mark.parametrize("order", ORDERS)
def test_the_mass_and_the_means_of_the_face_keep_its_integrals(order: int) -> None:
    face = Face(lines=np.array([0.0, 1.0, 2.5, 3.2, 4.0]), order=order)
    one, radius = np.ones_like(face.radius_mm), face.radius_mm
    assert one @ face.mass() @ one == pytest.approx(np.pi * 4.0**2)
    assert one @ face.mass() @ radius == pytest.approx(2 * np.pi * 4.0**3 / 3)
    assert radius @ face.mass() @ radius == pytest.approx(np.pi * 4.0**4 / 2)
    places = np.linspace(0.0, 4.0, 9)
    means = face.averages(places) @ radius
    assert hat_areas(places) @ means == pytest.approx(2 * np.pi * 4.0**3 / 3)


def test_a_layer_is_refined_towards_both_faces() -> None:
    lines = two_sided_lines(4.0, finest=0.1, growth=2.0, largest=1.0)
    np.testing.assert_allclose(lines, 4.0 - lines[::-1], atol=1e-14)
    assert lines[1] <= 0.1
    assert 2.0 in lines


@pytest.mark.parametrize(("half_width", "half_height"), [(2.0, 2.0), (3.0, 1.5), (1.0, 2.5)])
def test_the_mesh_around_a_spheroid_joins_boundary_and_spheroid(half_width: float, half_height: float) -> None:
    side = np.linspace(0.0, 6.0, 7)
    boundary = np.concatenate([np.column_stack([side, 0 * side]), np.column_stack([6 + 0 * side, 1.5 * side])[1:]])
    boundary = np.concatenate([boundary, np.column_stack([side[::-1], 9 + 0 * side])[1:]])
    shape = Spheroid(centre_depth=4.0, half_width=half_width, half_height=half_height)
    outer = mesh_around(boundary, shape, 2, layers=3)
    inner = mesh_inside(boundary, shape, 2, layers=1)
    np.testing.assert_allclose(outer.nodes[:, 0], boundary, atol=1e-12)
    r, z = outer.nodes[:, -1].T
    np.testing.assert_allclose((r / half_width) ** 2 + ((z - 4.0) / half_height) ** 2, 1.0, rtol=1e-12)
    np.testing.assert_allclose(inner.nodes[:, -1], outer.nodes[:, -1], atol=1e-12)
    np.testing.assert_allclose(inner.nodes[:, 0], np.tile([0.0, 4.0], (len(boundary), 1)), atol=1e-12)
    assert (outer.layers, inner.layers) == (3, 1)
