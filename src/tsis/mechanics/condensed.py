"""Static condensation, layer by layer: a body becomes the stiffness of the few displacements that others share.

A `Condensate` is a dense symmetric stiffness over numbered degrees of freedom. Bodies are swept one element layer at
a time: the layer is added, everything that no later layer and no neighbour needs is eliminated (Schur complement).
The answer equals that of one large sparse solve; it costs a few dense solves of about a hundred unknowns instead.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from tsis.mechanics.element import stiffness

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.mechanics.mesh import LayeredMesh

FIXED = -1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Condensate:
    """Stiffness in mN/mm, shape (n, n), over the degrees of freedom ``dofs``, shape (n,), ascending."""

    dofs: NDArray[np.int64]
    stiffness: NDArray[np.float64]

    def __add__(self, other: Condensate) -> Condensate:
        """Two bodies joined where they share degrees of freedom."""
        dofs = np.union1d(self.dofs, other.dofs)
        total = np.zeros((len(dofs), len(dofs)))
        here, there = np.searchsorted(dofs, self.dofs), np.searchsorted(dofs, other.dofs)
        total[here[:, None], here] = self.stiffness
        total[there[:, None], there] += other.stiffness
        return Condensate(dofs=dofs, stiffness=total)

    def __mul__(self, factor: float) -> Condensate:
        """The same body of ``factor`` times the modulus."""
        return Condensate(dofs=self.dofs, stiffness=factor * self.stiffness)

    def keep(self, dofs: NDArray[np.int64]) -> Condensate:
        """Eliminate everything but ``dofs``, on which no force acts from elsewhere."""
        kept = np.isin(self.dofs, dofs)
        out, stay = np.flatnonzero(~kept), np.flatnonzero(kept)
        if not out.size:
            return self
        order = np.concatenate([out, stay])
        matrix = self.stiffness[order[:, None], order]
        factor = cholesky(matrix[: out.size, : out.size], lower=True, check_finite=False)
        root = solve_triangular(factor, matrix[: out.size, out.size :], lower=True, check_finite=False)
        return Condensate(dofs=self.dofs[stay], stiffness=matrix[out.size :, out.size :] - root.T @ root)


EMPTY = Condensate(dofs=np.zeros(0, dtype=np.int64), stiffness=np.zeros((0, 0)))


def sweep(
    mesh: LayeredMesh,
    dofs: NDArray[np.int64],
    *,
    keep: NDArray[np.int64],
    young_kpa: NDArray[np.float64],
    poisson: NDArray[np.float64],
    start: Condensate = EMPTY,
) -> Condensate:
    """Condense a body from its first layer to its last.

    Parameters
    ----------
    mesh
        The body.
    dofs
        Number of each displacement, shape (na, nb, 2); `FIXED` where it is zero, equal numbers where tied.
    keep
        Numbers that survive wherever they occur; those of the last layer's far side survive too.
    young_kpa, poisson
        Material of each layer, shape (layers,).
    start
        A neighbour already condensed, attached to the first layers.
    """
    count = (mesh.order + 1) ** 2
    elements = np.stack([mesh.layer(index, mesh.nodes) for index in range(mesh.layers)])
    columns = elements.shape[1]
    matrices = stiffness(
        elements.reshape(-1, count, 2), mesh.order, np.repeat(young_kpa, columns), np.repeat(poisson, columns)
    )
    matrices, boundary = _without_interior(matrices, mesh.order)
    matrices = matrices.reshape(mesh.layers, columns, *matrices.shape[1:])
    carried = start
    for index in range(mesh.layers):
        numbers = mesh.layer(index, dofs).reshape(columns, 2 * count)[:, boundary]
        last = dofs[:, (index + 1) * mesh.order].ravel()
        joined = carried + _assemble(numbers, matrices[index])
        carried = joined.keep(np.concatenate([keep, last]))
    return carried


def _without_interior(matrices: NDArray[np.float64], order: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Eliminate the nodes inside each element; return the matrices and the positions of what is left."""
    inner = np.zeros((order + 1, order + 1, 2), dtype=bool)
    inner[1:-1, 1:-1] = True
    inside, rim = np.flatnonzero(inner.ravel()), np.flatnonzero(~inner.ravel())
    if not inside.size:
        return matrices, rim
    cross = matrices[:, inside[:, None], rim]
    core = np.linalg.solve(matrices[:, inside[:, None], inside], cross)
    return matrices[:, rim[:, None], rim] - np.swapaxes(cross, 1, 2) @ core, rim


def _assemble(numbers: NDArray[np.int64], matrices: NDArray[np.float64]) -> Condensate:
    """Add element matrices into one dense matrix over the free numbers that occur."""
    dofs, place = np.unique(numbers, return_inverse=True)
    place = place.reshape(numbers.shape)
    size = len(dofs)
    flat = (place[:, :, None] * size + place[:, None, :]).ravel()
    total = np.bincount(flat, weights=matrices.ravel(), minlength=size * size).astype(float).reshape(size, size)
    free = dofs != FIXED
    return Condensate(dofs=dofs[free], stiffness=total[np.ix_(free, free)])
