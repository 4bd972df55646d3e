"""Condensation layer by layer against one large sparse solve; interpolation and mass of the face."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.linalg import splu

from tsis.mechanics.mesh import LayeredMesh, Spheroid, sphere_on_axis, stiffness
from tsis.mechanics.small_strain import slab
from tsis.mechanics.small_strain import slab as bodies
from tsis.mechanics.small_strain.slab import EMPTY, FIXED, Condensate, Resolution, condense_layers, face_of
from tsis.model.probe import Layer, Probe

if TYPE_CHECKING:
    from numpy.typing import NDArray


COARSE = Resolution(order=3, edge=0.1, growth=2.5, largest=0.4, below_cells=2, ray_layers=3)

Part = tuple[LayeredMesh, "NDArray[np.int64]", "NDArray[np.float64]", "NDArray[np.float64]"]


def element_matrices(parts: list[Part]) -> list[tuple[NDArray[np.int64], NDArray[np.float64]]]:
    """Numbers and stiffness of every element, without what is fixed."""
    found = []
    for body, dofs, young, poisson in parts:
        count = (body.order + 1) ** 2
        for index in range(body.layers):
            nodes = body.layer(index, body.nodes)
            numbers = body.layer(index, dofs).reshape(len(nodes), 2 * count)
            for place, element in enumerate(nodes):
                matrix = stiffness(element[None], body.order, young[index : index + 1], poisson[index : index + 1])[0]
                free = np.flatnonzero(numbers[place] != FIXED)
                found.append((numbers[place][free], matrix[np.ix_(free, free)]))
    return found


def one_large_solve(parts: list[Part], faces: int) -> NDArray[np.float64]:
    """Displacements of the first ``faces`` numbers by unit forces on them: every element into one sparse matrix."""
    used, moved = all_displacements(parts, np.eye(faces))
    return moved[np.searchsorted(used, np.arange(faces))]


def all_displacements(parts: list[Part], forces: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """All numbers, and their displacements by ``forces`` (faces, cases) on the first ones."""
    elements = element_matrices(parts)
    grids = [np.meshgrid(numbers, numbers, indexing="ij") for numbers, _ in elements]
    row, column = (np.concatenate([grid[axis].ravel() for grid in grids]) for axis in (0, 1))
    used = np.union1d(row, [])
    size = len(used)
    values = np.concatenate([matrix.ravel() for _, matrix in elements])
    whole = sparse.csc_matrix((values, (np.searchsorted(used, row), np.searchsorted(used, column))), shape=(size, size))
    load = np.zeros((size, forces.shape[1]))
    load[: len(forces)] = forces
    return used, np.asarray(splu(whole).solve(load), dtype=float)


@pytest.fixture
def swept(monkeypatch: pytest.MonkeyPatch) -> list[Part]:
    """Every part that is condensed, as it was given."""
    parts: list[Part] = []

    def record(body: LayeredMesh, dofs: NDArray[np.int64], **given: Any) -> Condensate:
        parts.append((body, dofs.copy(), given["young_kpa"], given["poisson"]))
        return condense_layers(body, dofs, **given)

    for module in (bodies, slab):
        monkeypatch.setattr(module, "condense_layers", record)
    return parts


def assert_same(compliance: NDArray[np.float64], expected: NDArray[np.float64]) -> None:
    np.testing.assert_allclose(compliance, expected, atol=1e-9 * np.abs(expected).max(), rtol=0)


FACE = face_of(12.0, COARSE)
BALL = sphere_on_axis(10.0, 5.0)


@pytest.mark.parametrize("curvature", [None, 40.0])
def test_probe(swept: list[Part], curvature: float | None) -> None:
    layers = (Layer(thickness_mm=2.0, young_kpa=140.0), Layer(thickness_mm=5.0, young_kpa=34.0, poisson=0.3))
    probe = Probe(radius_mm=12.0, layers=layers, face_curvature_mm=curvature)
    found = bodies.probe_compliance(probe, FACE, COARSE)
    assert len(swept) == 1
    assert set(swept[0][2]) == {140.0, 34.0}
    assert_same(found, one_large_solve(swept, len(found)))


def test_a_rim_bonded_to_the_housing_does_not_move(swept: list[Part]) -> None:
    probe = Probe(radius_mm=12.0, layers=(Layer(thickness_mm=5.0, young_kpa=34.0),), sides="bonded")
    found = bodies.probe_compliance(probe, FACE, COARSE)
    assert not found[-1].any()
    assert not found[:, -1].any()
    free = len(found) - 1
    assert_same(found[:free, :free], one_large_solve(swept, free))


def plain_slab(resolution: Resolution = COARSE) -> slab.Slab:
    return slab.Slab(
        thickness_mm=30.0, poisson=0.49, face=face_of(12.0, resolution), block_mm=9.0, resolution=resolution
    )


@pytest.mark.parametrize("shape", [BALL, Spheroid(centre_depth=8.0, half_width=6.0, half_height=2.0)])
def test_slab_with_an_inclusion(swept: list[Part], shape: Spheroid) -> None:
    found = plain_slab().with_inclusion(shape, poisson=0.49).compliance(20.0)
    assert len(swept) == 3
    swept[-1] = (*swept[-1][:2], 20.0 * swept[-1][2], swept[-1][3])
    assert_same(found, one_large_solve(swept, len(found)))


def test_slab_with_an_inclusion_of_its_own_poisson_ratio(swept: list[Part]) -> None:
    body = plain_slab().with_inclusion(BALL, poisson=0.3)
    around, ball, plain = swept[:2], swept[2], swept[3]
    assert (ball[3][0], plain[3][0]) == (0.3, 0.49)
    stiff = (*ball[:2], 8.0 * ball[2], ball[3])
    found = body.compliance(8.0)
    assert_same(found, one_large_solve([*around, stiff], len(found)))
    assert_same(body.tissue_compliance, one_large_solve([*around, plain], len(found)))
    assert_same(body.change(8.0), found - body.tissue_compliance)


def test_plain_slab(swept: list[Part]) -> None:
    found = plain_slab().compliance
    assert_same(found, one_large_solve(swept, len(found)))


def test_plain_slab_agrees_with_an_inclusion_of_no_contrast() -> None:
    body = plain_slab(Resolution())
    alike = body.with_inclusion(BALL, poisson=0.49).tissue_compliance
    stiffness_of = [np.linalg.inv(compliance).sum() for compliance in (body.compliance, alike)]
    assert stiffness_of[0] == pytest.approx(stiffness_of[1], rel=2e-4)


def test_the_work_of_the_force_is_the_strain_energy_of_every_element(swept: list[Part]) -> None:
    """F delta / 2 against the energies of all elements of probe and slab, displaced by the contact's forces."""
    layers = (Layer(thickness_mm=2.0, young_kpa=140.0), Layer(thickness_mm=5.0, young_kpa=34.0))
    both = bodies.probe_compliance(Probe(radius_mm=12.0, layers=layers), FACE, COARSE)
    body = plain_slab().with_inclusion(BALL, poisson=0.49)
    both = both + body.compliance(20.0)
    force = np.linalg.solve(both, np.ones(len(both)))
    travel, force = 1000.0 / force.sum(), force * 1000.0 / force.sum()
    swept[-1] = (*swept[-1][:2], 20.0 * swept[-1][2], swept[-1][3])
    energy = 0.0
    for parts in (swept[:1], swept[1:]):
        used, moved = all_displacements(parts, force[:, None])
        for numbers, matrix in element_matrices(parts):
            part = moved[np.searchsorted(used, numbers), 0]
            energy += 0.5 * float(part @ matrix @ part)
    assert energy == pytest.approx(0.5 * 1000.0 * travel, rel=1e-8)


def test_adding_joins_shared_numbers_only() -> None:
    left = Condensate(dofs=np.array([0, 1]), stiffness=np.array([[2.0, -2.0], [-2.0, 2.0]]))
    right = Condensate(dofs=np.array([1, 4]), stiffness=np.array([[3.0, -3.0], [-3.0, 3.0]]))
    both = left + right * 2.0
    assert both.dofs.tolist() == [0, 1, 4]
    assert both.stiffness.tolist() == [[2.0, -2.0, 0.0], [-2.0, 8.0, -6.0], [0.0, -6.0, 6.0]]
    series = both.restrict(np.array([0, 4]))  # two springs in a row
    np.testing.assert_allclose(series.stiffness, 1.5 * np.array([[1.0, -1.0], [-1.0, 1.0]]), atol=1e-12)
    assert (EMPTY + left).stiffness.tolist() == left.stiffness.tolist()
    assert left.restrict(np.array([0, 1])) is left


WIDE_FACE = face_of(12.0, Resolution())


def test_nodes_run_from_the_axis_to_the_edge() -> None:
    assert (WIDE_FACE.radius_mm[0], WIDE_FACE.radius_mm[-1]) == (0.0, 12.0)
    assert (np.diff(WIDE_FACE.radius_mm) > 0).all()
    smallest = np.diff(WIDE_FACE.lines)[-1]
    assert smallest == np.diff(WIDE_FACE.lines).min() <= 0.01 * 12.0


def test_interpolation_reproduces_polynomials_of_the_elements_order() -> None:
    radius = np.linspace(0.0, 12.0, 101)
    given = np.polynomial.Polynomial([1.0, -2.0, 0.3, 0.05, -0.004, 0.0003])
    np.testing.assert_allclose(WIDE_FACE.interpolation(radius) @ given(WIDE_FACE.radius_mm), given(radius), rtol=1e-10)


def test_interpolation_at_the_nodes_is_the_identity() -> None:
    np.testing.assert_allclose(
        WIDE_FACE.interpolation(WIDE_FACE.radius_mm), np.eye(len(WIDE_FACE.radius_mm)), atol=1e-12
    )


def test_mass_turns_pressure_into_force() -> None:
    mass, radius = WIDE_FACE.mass(), WIDE_FACE.radius_mm
    np.testing.assert_allclose(mass, mass.T, atol=1e-12)
    assert mass.sum() == pytest.approx(np.pi * 144.0, rel=1e-12)
    # p = r**3 on the face, weighed by r**2: 2 pi r**6 integrated.
    assert radius**2 @ mass @ radius**3 == pytest.approx(2 * np.pi * 12.0**7 / 7, rel=1e-12)


def test_averages_keep_the_integral_and_what_is_constant() -> None:
    grid = np.linspace(0.0, 12.0, 241)
    matrix = WIDE_FACE.averages(grid)
    np.testing.assert_allclose(matrix.sum(axis=1), 1.0, rtol=1e-12)
    singular = 1 / np.sqrt(12.3**2 - WIDE_FACE.radius_mm**2)
    total = np.ones(len(WIDE_FACE.radius_mm)) @ WIDE_FACE.mass() @ singular
    assert 2 * np.pi * np.trapezoid(grid * (matrix @ singular), grid) == pytest.approx(total, rel=2e-4)
    # A hat of half-width h has the second moment h**2 / 6; the weight r makes it count three times for a parabola.
    np.testing.assert_allclose((matrix @ WIDE_FACE.radius_mm**2 - grid**2)[40:-1], 3 * 0.05**2 / 6, rtol=0.01)
