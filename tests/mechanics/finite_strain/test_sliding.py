"""Bodies of the finite-strain model: patch tests through elements and through a sliding contact, derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from tsis.errors import MechanicsError
from tsis.mechanics.finite_strain import equilibrium as load_path
from tsis.mechanics.finite_strain import neo_hookean
from tsis.mechanics.finite_strain.equilibrium import Load, Potential
from tsis.mechanics.finite_strain.neo_hookean import FIXED, OWN, ElasticBody, number_unknowns
from tsis.mechanics.finite_strain.patches import MeshPatch, Solid, join_meshes, weld
from tsis.mechanics.finite_strain.sliding import Plate, SlidingContact, SmoothFace, SoftFace
from tsis.mechanics.mesh import LayeredMesh, lame_constants, mesh_rectangle

YOUNG, POISSON, RADIUS = 5.0, 0.49, 3.0


def cylinder(columns: int, low: float, high: float, order: int = 4, *, bent: float = 0.0) -> Solid:
    """A cylinder of radius 3 mm, its inner nodes bent so that the elements are no rectangles."""
    straight = mesh_rectangle(np.linspace(0, RADIUS, columns + 1), np.linspace(low, high, 3), order, a_is_radius=True)
    nodes = straight.nodes.copy()
    # Quadratic, so that integration is still exact.
    swell = nodes[..., 0] * (RADIUS - nodes[..., 0]) * (nodes[..., 1] - low) * (high - nodes[..., 1])
    nodes += bent * swell[..., None] * [1.0, -0.7]
    layers = np.full(2, 1.0)
    patch = MeshPatch(mesh=LayeredMesh(nodes=nodes, order=order), young_kpa=YOUNG * layers, poisson=POISSON * layers)
    return weld([patch])


def free_body(solid: Solid) -> ElasticBody:
    return ElasticBody(solid, number_unknowns(solid, np.full((len(solid.nodes), 2), OWN), 0))


def test_an_even_deformation_of_uneven_elements_is_exact() -> None:
    body = free_body(cylinder(3, 0.0, 2.0, bent=0.15))
    moved = body.solid.nodes * [0.2, -0.3]
    assert body.volume.sum() == pytest.approx(np.pi * RADIUS**2 * 2.0, rel=1e-12)
    mu, lam = lame_constants(np.array(YOUNG), np.array(POISSON))
    density = neo_hookean.energy(np.array([1.2, 0, 0, 0.7, 1.2]), mu, lam)
    assert body.energy(moved) == pytest.approx(float(density) * np.pi * RADIUS**2 * 2.0, rel=1e-12)
    total = np.zeros_like(moved)
    np.add.at(total, body.solid.cells, body.forces(moved))
    nodes = body.solid.nodes
    inside = (nodes[:, 0] > 1e-9) & (nodes[:, 0] < RADIUS - 1e-9) & (nodes[:, 1] > 1e-9) & (nodes[:, 1] < 2 - 1e-9)
    assert inside.sum() > 50
    np.testing.assert_allclose(total[inside], 0.0, atol=1e-10 * np.abs(total).max())


def test_element_forces_and_matrices_are_derivatives_of_the_energy() -> None:
    body = free_body(cylinder(2, 0.0, 2.0, 3, bent=0.1))
    nodes = body.solid.nodes
    moved = 0.1 * np.sin(nodes[:, ::-1] * [1.3, 0.9]) * nodes[:, :1] / RADIUS
    way = np.cos(nodes * [0.7, 1.1]) * nodes[:, :1]
    step = 1e-5
    rise = (body.energy(moved + step * way) - body.energy(moved - step * way)) / (2 * step)
    assert float((body.forces(moved) * way[body.solid.cells]).sum()) == pytest.approx(rise, rel=1e-7)
    change = (body.forces(moved + step * way) - body.forces(moved - step * way)) / (2 * step)
    local = way[body.solid.cells].reshape(len(body.solid.cells), -1, 1)
    found = (body.matrices(moved) @ local).reshape(change.shape)
    np.testing.assert_allclose(found, change, rtol=1e-6, atol=1e-6 * np.abs(change).max())


def two_cylinders(upper_columns: int) -> tuple[Solid, SlidingContact, np.ndarray]:
    """One cylinder on another, with meshes that do not match; the face belongs to the upper one."""
    upper, lower = cylinder(upper_columns, -2.0, 0.0), cylinder(3, 0.0, 2.0)
    solid = join_meshes(upper, lower)
    face_nodes, skin = solid.patches[0][:, -1], solid.patches[1][:, 0]
    face = SmoothFace(upper.nodes[face_nodes, 0], 4, lambda arc: np.column_stack([arc, np.zeros_like(arc)]))
    contact = SlidingContact(solid.nodes, skin, 4, SoftFace(face, face_nodes), 2e3, 1e2)
    return solid, contact, solid.patches[0][:, 0]


def touching_cylinders(upper_columns: int) -> tuple[Solid, Potential, load_path.State]:
    """Two cylinders between plates at their first touch; the travel of the upper plate is the first unknown."""
    solid, contact, top = two_cylinders(upper_columns)
    shared = np.full((len(solid.nodes), 2), OWN)
    shared[solid.nodes[:, 0] < 1e-9, 0] = FIXED
    shared[top, 1] = 0
    shared[solid.nodes[:, 1] > 2 - 1e-9, 1] = FIXED
    body = ElasticBody(solid, number_unknowns(solid, shared, 1))
    potential = Potential(body, [contact], 0)

    def moved(travel: float) -> np.ndarray:
        unknowns = np.zeros(potential.size)
        axial = body.numbering.of_node[: solid.patches[1].min(), 1]
        unknowns[axial[axial >= 0]] = travel
        return unknowns

    return solid, potential, load_path.find_first_contact(potential, moved, 0.02, 1e6, below_mn=10.0)


def test_an_even_pressure_passes_between_meshes_that_do_not_match() -> None:
    solid, potential, first = touching_cylinders(4)
    force = 40.0
    (state,) = load_path.follow_load_path(potential, first, [force], refuse=lambda _: None)
    mu, lam = (float(value) for value in lame_constants(np.array(YOUNG), np.array(POISSON)))

    def across(axial: float) -> float:
        return float(brentq(lambda a: mu * (a - 1 / a) + lam * np.log(axial * a * a) / a, 0.8, 2.0, xtol=1e-14))

    def pressure(axial: float) -> float:
        return mu * (across(axial) ** 2 / axial - axial)

    even = force / (np.pi * RADIUS**2)
    stretch = float(brentq(lambda axial: pressure(axial) - even, 0.3, 1.0, xtol=1e-14))
    assert state.unknowns[0] == pytest.approx(4 * (1 - stretch) + even / 2e3, rel=1e-5)
    displacements = potential.displacements(state.unknowns)
    np.testing.assert_allclose(displacements[:, 0], (across(stretch) - 1) * solid.nodes[:, 0], atol=1e-4)


def test_a_refused_state_names_its_load_and_the_last_that_was_not_refused() -> None:
    _, potential, first = touching_cylinders(3)
    path = load_path.follow_load_path(
        potential, first, [20.0, 40.0], refuse=lambda state: "too much" if state.load.force_mn > 20.0 else None
    )
    assert next(path).load.force_mn == 20.0
    with pytest.raises(MechanicsError, match=r"^too much at 0\.0\d+ N; .* is 0\.02 N: choose at most that$") as refused:
        next(path)
    assert 0.02 < float(str(refused.value).split(" ")[3]) <= 0.04


def test_the_contacts_forces_and_tangent_are_derivatives_of_its_energy() -> None:
    solid, contact, _ = two_cylinders(4)
    positions = solid.nodes + 0.004 * np.sin(2 * solid.nodes + 0.5) * [[1, 1]]
    positions[: solid.patches[1].min(), 1] += 0.03  # pressed into the lower one, not everywhere alike
    way = np.sin(3 * positions[contact.nodes] + 0.3)

    def at(step: float) -> np.ndarray:
        shifted = positions.copy()
        shifted[contact.nodes] += step * way
        return shifted

    step = 1e-6
    found = contact.derivatives(positions, contact.pressure(positions))
    rise = (contact.energy(at(step)) - contact.energy(at(-step))) / (2 * step)
    assert float(found.forces @ way.ravel()) == pytest.approx(rise, rel=1e-6)
    above, below = (contact.derivatives(at(s), contact.pressure(at(s))).forces for s in (step, -step))
    change = (above - below) / (2 * step)
    np.testing.assert_allclose(found.matrix @ way.ravel(), change, rtol=1e-5, atol=1e-5 * np.abs(change).max())
    np.testing.assert_allclose(found.matrix, found.matrix.T, atol=1e-9 * np.abs(found.matrix).max())


def test_no_force_where_bodies_are_apart() -> None:
    solid, contact, _ = two_cylinders(3)
    positions = solid.nodes.copy()
    positions[: solid.patches[1].min(), 1] -= 0.01
    assert contact.energy(positions) == 0.0
    assert contact.pressed(positions) == []
    found = contact.derivatives(positions, contact.pressure(positions))
    assert not found.forces.any()


def test_the_edge_of_a_contact_moves_smoothly_through_an_element() -> None:
    """The force of a face that is tilted against the other grows smoothly, not by jumps of integration points."""
    solid, contact, _ = two_cylinders(3)
    overlaps = np.linspace(0.001, 0.02, 400)
    forces = []
    for overlap in overlaps:
        positions = solid.nodes.copy()
        upper = slice(0, int(solid.patches[1].min()))
        positions[upper, 1] += overlap - 0.03 * (positions[upper, 0] / RADIUS) ** 2
        forces.append(contact.derivatives(positions, contact.pressure(positions)).forces[1::2][:13].sum())
    # The paraboloid's exact force: stiffness times the volume of the overlap, pi R^2 d^2 / (2 * 0.03).
    exact = 2e3 * np.pi * RADIUS**2 * overlaps**2 / (2 * 0.03)
    np.testing.assert_allclose(-np.array(forces), exact, rtol=1e-3)


def test_a_plate_moves_towards_smaller_z() -> None:
    plate = Plate(0, 2.0)
    points = np.array([[0.5, 1.9], [1.0, 1.4]])
    np.testing.assert_allclose(plate.gap(np.array([[0.0, 0.5]]), points), [-0.4, 0.1])


@pytest.mark.parametrize("load", [Load(spring=1e3, travel_mm=1e-3), Load(force_mn=3.0)], ids=["spring", "force"])
def test_the_condensed_model_predicts_the_energy(load: Load) -> None:
    """Newton's step from rest lowers the energy by half of its slope, to second order."""
    solid, contact, top = two_cylinders(3)
    shared = np.full((len(solid.nodes), 2), OWN)
    shared[solid.nodes[:, 0] < 1e-9, 0] = FIXED
    shared[top, 1] = 0
    shared[solid.nodes[:, 1] > 2 - 1e-9, 1] = FIXED
    body = ElasticBody(solid, number_unknowns(solid, shared, 1))
    potential = Potential(body, [contact], 0)
    unknowns = np.zeros(potential.size)
    axial = body.numbering.of_node[: solid.patches[1].min(), 1]
    unknowns[axial[axial >= 0]] = 1e-3
    model = potential.quadratic(unknowns, potential.pressures(unknowns), load)
    step = model.step()
    size = 1e-3
    rise = potential.energy(unknowns + size * step, load) - potential.energy(unknowns - size * step, load)
    assert model.slope(step) == pytest.approx(rise / (2 * size), rel=1e-5)
