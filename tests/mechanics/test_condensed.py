"""Condensation layer by layer against one large sparse solve of the same mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.linalg import splu

from tsis import Layer, Probe
from tsis.mechanics import Resolution, bodies, mesh
from tsis.mechanics.condensed import EMPTY, FIXED, Condensate, sweep
from tsis.mechanics.element import stiffness

if TYPE_CHECKING:
    from numpy.typing import NDArray

COARSE = Resolution(order=3, edge=0.1, growth=2.5, largest=0.4, below_cells=2, ray_layers=3)

Part = tuple[mesh.LayeredMesh, "NDArray[np.int64]", "NDArray[np.float64]", "NDArray[np.float64]"]


def one_large_solve(parts: list[Part], faces: int) -> NDArray[np.float64]:
    """Displacements of the first ``faces`` numbers by unit forces on them: every element into one sparse matrix."""
    rows, columns, values = [], [], []
    for body, dofs, young, poisson in parts:
        count = (body.order + 1) ** 2
        for index in range(body.layers):
            nodes = body.layer(index, body.nodes)
            numbers = body.layer(index, dofs).reshape(len(nodes), 2 * count)
            for place, element in enumerate(nodes):
                matrix = stiffness(element[None], body.order, young[index : index + 1], poisson[index : index + 1])[0]
                free = np.flatnonzero(numbers[place] != FIXED)
                row, column = np.meshgrid(numbers[place][free], numbers[place][free], indexing="ij")
                rows.append(row.ravel())
                columns.append(column.ravel())
                values.append(matrix[np.ix_(free, free)].ravel())
    row, column = np.concatenate(rows), np.concatenate(columns)
    used = np.union1d(row, [])
    size = len(used)
    whole = sparse.csc_matrix(
        (np.concatenate(values), (np.searchsorted(used, row), np.searchsorted(used, column))), shape=(size, size)
    )
    forces = np.zeros((size, faces))
    forces[np.arange(faces), np.arange(faces)] = 1.0
    return np.asarray(splu(whole).solve(forces)[:faces], dtype=float)


@pytest.fixture
def swept(monkeypatch: pytest.MonkeyPatch) -> list[Part]:
    """Every part that `bodies` condenses, as it was given."""
    parts: list[Part] = []

    def record(body: mesh.LayeredMesh, dofs: NDArray[np.int64], **given: Any) -> Condensate:
        parts.append((body, dofs.copy(), given["young_kpa"], given["poisson"]))
        return sweep(body, dofs, **given)

    monkeypatch.setattr(bodies, "sweep", record)
    return parts


def assert_same_compliance(stiffness: NDArray[np.float64], expected: NDArray[np.float64]) -> None:
    np.testing.assert_allclose(np.linalg.inv(stiffness), expected, atol=1e-9 * np.abs(expected).max(), rtol=0)


def test_probe(swept: list[Part]) -> None:
    layers = (Layer(thickness_mm=2.0, young_kpa=140.0), Layer(thickness_mm=5.0, young_kpa=34.0, poisson=0.3))
    found = bodies.probe_stiffness(Probe(radius_mm=12.0, layers=layers), COARSE)
    assert len(swept) == 1
    assert set(swept[0][2]) == {140.0, 34.0}
    assert_same_compliance(found, one_large_solve(swept, len(found)))


def slab() -> bodies.Slab:
    return bodies.Slab(thickness_mm=30.0, poisson=0.49, probe_radius_mm=12.0, block_mm=9.0, resolution=COARSE)


def test_slab_with_a_sphere(swept: list[Part]) -> None:
    body = slab().with_sphere(diameter_mm=10.0, depth_mm=5.0, poisson=0.49)
    found = body.stiffness(20.0)
    assert len(swept) == 3
    swept[-1] = (*swept[-1][:2], 20.0 * swept[-1][2], swept[-1][3])
    assert_same_compliance(found, one_large_solve(swept, len(found)))


def test_slab_with_a_sphere_of_its_own_poisson_ratio(swept: list[Part]) -> None:
    body = slab().with_sphere(diameter_mm=10.0, depth_mm=5.0, poisson=0.3)
    around, ball, plain = swept[:2], swept[2], swept[3]
    assert (ball[3][0], plain[3][0]) == (0.3, 0.49)
    stiff = (*ball[:2], 8.0 * ball[2], ball[3])
    found = body.stiffness(8.0)
    assert_same_compliance(found, one_large_solve([*around, stiff], len(found)))
    assert_same_compliance(body.plain_stiffness(), one_large_solve([*around, plain], len(found)))


def test_plain_slab(swept: list[Part]) -> None:
    found = slab().plain_stiffness()
    assert_same_compliance(found, one_large_solve(swept, len(found)))


def test_plain_slab_agrees_with_a_sphere_of_no_contrast() -> None:
    fine = Resolution()
    body = bodies.Slab(thickness_mm=30.0, poisson=0.49, probe_radius_mm=12.0, block_mm=9.6, resolution=fine)
    with_sphere = body.with_sphere(diameter_mm=10.0, depth_mm=5.0, poisson=0.49)
    assert body.plain_stiffness().sum() == pytest.approx(with_sphere.plain_stiffness().sum(), rel=2e-4)


def test_adding_joins_shared_numbers_only() -> None:
    left = Condensate(dofs=np.array([0, 1]), stiffness=np.array([[2.0, -2.0], [-2.0, 2.0]]))
    right = Condensate(dofs=np.array([1, 4]), stiffness=np.array([[3.0, -3.0], [-3.0, 3.0]]))
    both = left + right * 2.0
    assert both.dofs.tolist() == [0, 1, 4]
    assert both.stiffness.tolist() == [[2.0, -2.0, 0.0], [-2.0, 8.0, -6.0], [0.0, -6.0, 6.0]]
    series = both.keep(np.array([0, 4]))  # two springs in a row
    np.testing.assert_allclose(series.stiffness, 1.5 * np.array([[1.0, -1.0], [-1.0, 1.0]]), atol=1e-12)
    assert (EMPTY + left).stiffness.tolist() == left.stiffness.tolist()
    assert left.keep(np.array([0, 1])) is left
