"""Meshes for large deformations: patches of quadrilaterals welded together, one list of nodes a body."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from tsis.mechanics._mesh import layer_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.mechanics._element import Floats, Integers
    from tsis.mechanics._mesh import LayeredMesh
    from tsis.model import Layer, Phantom


SAME_POINT_MM = 1e-7


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MeshPatch:
    """One logical rectangle of elements and the material of each element layer, shape (layers,)."""

    mesh: LayeredMesh
    young_kpa: Floats
    poisson: Floats

    @classmethod
    def uniform(cls, mesh: LayeredMesh, material: Phantom | Layer) -> MeshPatch:
        """A patch of one material."""
        young, poisson = (np.full(mesh.layers, value) for value in (material.young_kpa, material.poisson))
        return cls(mesh=mesh, young_kpa=young, poisson=poisson)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solid:
    """A body as a list of nodes and elements."""

    nodes: Floats  # reference positions (r, z) in mm, shape (n, 2)
    cells: Integers  # nodes of each element in the order of `reference_element`, shape (elements, (order + 1)**2)
    order: int  # polynomial order
    young_kpa: Floats  # of each element
    poisson: Floats  # of each element
    patches: tuple[Integers, ...]  # node indices of each welded patch in its logical grid, shape (na, nb)

    def shifted(self, first: int) -> tuple[Integers, ...]:
        """Node indices of the patches, counted from ``first``."""
        return tuple(patch + first for patch in self.patches)


def weld(patches: Sequence[MeshPatch]) -> Solid:
    """One body from patches: nodes at one position are merged, also those of collapsed edges."""
    positions = np.concatenate([patch.mesh.nodes.reshape(-1, 2) for patch in patches])
    pairs = cKDTree(positions).query_pairs(SAME_POINT_MM, output_type="ndarray")
    links = coo_array((np.ones(len(pairs), dtype=bool), (pairs[:, 0], pairs[:, 1])), shape=(len(positions),) * 2)
    count, label = connected_components(links, directed=False)
    nodes = np.zeros((count, 2))
    nodes[label] = positions
    numbers, cells, young, poisson, start = [], [], [], [], 0
    for patch in patches:
        shape = patch.mesh.nodes.shape[:2]
        grid = label[start : start + shape[0] * shape[1]].reshape(shape).astype(np.int64)
        start += grid.size
        numbers.append(grid)
        for layer in range(patch.mesh.layers):
            row = layer_of(grid, patch.mesh.order, layer)
            cells.append(row)
            young.append(np.full(len(row), patch.young_kpa[layer]))
            poisson.append(np.full(len(row), patch.poisson[layer]))
    return Solid(
        nodes=nodes,
        cells=np.concatenate(cells),
        order=patches[0].mesh.order,
        young_kpa=np.concatenate(young),
        poisson=np.concatenate(poisson),
        patches=tuple(numbers),
    )


def join_meshes(solid: Solid, other: Solid) -> Solid:
    """Two separate bodies of one order in one list of nodes: first ``solid``, then ``other``."""
    first = len(solid.nodes)
    return Solid(
        nodes=np.concatenate([solid.nodes, other.nodes]),
        cells=np.concatenate([solid.cells, other.cells + first]),
        order=solid.order,
        young_kpa=np.concatenate([solid.young_kpa, other.young_kpa]),
        poisson=np.concatenate([solid.poisson, other.poisson]),
        patches=solid.patches + other.shifted(first),
    )
