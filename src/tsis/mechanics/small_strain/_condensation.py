"""Static condensation, layer by layer: a body becomes the stiffness of the few displacements that others share.

A `Condensate` is a dense symmetric stiffness over numbered degrees of freedom. Bodies are swept one element layer at
a time: the layer is added, everything that no later layer and no neighbour needs is eliminated (Schur complement).
The answer equals that of one large sparse solve; it costs a few dense solves of about a hundred unknowns instead.
Where each number goes depends on the numbering alone and not on the shape: `CondensationStep` is computed once.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg.lapack import dpotrf, dtrtri

from tsis.mechanics._element import stiffness
from tsis.mechanics._mesh import layer_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.mechanics._mesh import LayeredMesh


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

    def restrict(self, dofs: NDArray[np.int64]) -> Condensate:
        """Eliminate everything but ``dofs``, on which no force acts from elsewhere."""
        selected = np.isin(self.dofs, dofs)
        out, stay = np.flatnonzero(~selected), np.flatnonzero(selected)
        if not out.size:
            return self
        order = np.concatenate([out, stay])
        return Condensate(dofs=self.dofs[stay], stiffness=_eliminate(self.stiffness[order[:, None], order], out.size))


def _eliminate(matrix: NDArray[np.float64], first: int) -> NDArray[np.float64]:
    """Schur complement that is left when the ``first`` degrees of freedom are eliminated."""
    # LAPACK and BLAS themselves: for matrices this small, what is wrapped around them costs as much as they do.
    factor, failed = dpotrf(matrix[:first, :first], lower=1)
    if failed:
        raise np.linalg.LinAlgError("a body's stiffness must be positive definite; it is not")
    # A triangular solve would be shorter, but SciPy's holds the interpreter's lock, and slabs are solved in threads.
    root = dtrtri(factor, lower=1, overwrite_c=1)[0] @ matrix[:first, first:]
    return np.asarray(matrix[first:, first:] - root.T @ root)


EMPTY = Condensate(dofs=np.zeros(0, dtype=np.int64), stiffness=np.zeros((0, 0)))


def condense_layers(
    mesh: LayeredMesh,
    dofs: NDArray[np.int64],
    *,
    save: NDArray[np.int64],
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
    save
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
    rims = _without_interior(matrices, mesh.order).reshape(mesh.layers, -1)
    transported = start.stiffness
    steps = _steps(mesh.order, dofs.shape, dofs.tobytes(), save.tobytes(), start.dofs.tobytes())
    for step, values in zip(steps, rims, strict=True):
        # One slot more than the matrix has, for everything that is fixed.
        flat = np.bincount(step.element_slots, weights=values, minlength=step.size**2 + 1)[:-1].astype(float)
        flat[step.transferred_slots] += transported.ravel()
        total = flat.reshape(step.size, step.size)
        transported = _eliminate(total, step.eliminated)
    return Condensate(dofs=steps[-1].dofs, stiffness=transported)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CondensationStep:
    """Where the numbers of one element layer go: into a matrix whose first rows are eliminated.

    Attributes
    ----------
    size, eliminated
        Rows of the matrix, and how many of them are eliminated.
    element_slots
        Place of each entry of the layer's elements in the flat matrix; the one behind its end where it is fixed.
    transferred_slots
        Place of each entry of what was carried here.
    dofs
        What is carried on, ascending.
    """

    size: int
    eliminated: int
    element_slots: NDArray[np.int64]
    transferred_slots: NDArray[np.int64]
    dofs: NDArray[np.int64]


@lru_cache(maxsize=64)
def _steps(
    order: int, shape: tuple[int, int, int], dofs: bytes, save: bytes, start: bytes
) -> tuple[CondensationStep, ...]:
    """The steps of a sweep; the arrays come as bytes, by which they are remembered."""
    numbers, selected = np.frombuffer(dofs, dtype=np.int64).reshape(shape), np.frombuffer(save, dtype=np.int64)
    transported = np.frombuffer(start, dtype=np.int64)
    steps = []
    for index in range((shape[1] - 1) // order):
        layer = layer_of(numbers, order, index).reshape(-1, 2 * (order + 1) ** 2)[:, _rim(order)]
        last = numbers[:, (index + 1) * order].ravel()
        present = np.union1d(layer, transported)
        present = present[present != FIXED]
        stays = np.isin(present, np.concatenate([selected, last]))
        ordered = np.concatenate([present[~stays], present[stays]])
        size, position = len(ordered), np.argsort(ordered)
        there = position[np.minimum(np.searchsorted(present, layer), size - 1)]
        slots = there[:, :, None] * size + there[:, None, :]
        fixed = layer == FIXED
        slots[fixed[:, :, None] | fixed[:, None, :]] = size * size
        here = position[np.searchsorted(present, transported)]
        transported = present[stays]
        steps.append(
            CondensationStep(
                size=size,
                eliminated=int(np.count_nonzero(~stays)),
                element_slots=slots.ravel(),
                transferred_slots=(here[:, None] * size + here).ravel(),
                dofs=transported,
            )
        )
    return tuple(steps)


def _without_interior(matrices: NDArray[np.float64], order: int) -> NDArray[np.float64]:
    """Eliminate the nodes inside each element."""
    rim = _rim(order)
    inside = np.setdiff1d(np.arange(2 * (order + 1) ** 2), rim)
    if not inside.size:
        return matrices
    cross = matrices[:, inside[:, None], rim]
    core = np.linalg.solve(matrices[:, inside[:, None], inside], cross)
    return np.asarray(matrices[:, rim[:, None], rim] - np.swapaxes(cross, 1, 2) @ core)


@cache
def _rim(order: int) -> NDArray[np.int64]:
    """Positions, among an element's displacements, of those on its sides."""
    inner = np.zeros((order + 1, order + 1, 2), dtype=bool)
    inner[1:-1, 1:-1] = True
    return np.flatnonzero(~inner.ravel())
