"""Static condensation, layer by layer: a body becomes the stiffness of the few displacements common with others.

A `Condensate` is a dense symmetric stiffness over numbered degrees of freedom. Each step adds one element layer and
eliminates the displacements that neither a later layer nor a neighbour needs (Schur complement). The result equals
one large sparse solve but costs only a few dense solves of about a hundred unknowns. The indices of a
`CondensationStep` depend only on the numbering, not on the shape, and are computed once.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.mechanics._element import Floats, Integers, stiffness
from tsis.mechanics._mesh import layer_of

if TYPE_CHECKING:
    from tsis.mechanics._mesh import LayeredMesh


FIXED = -1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Condensate:
    """Stiffness in mN/mm, shape (n, n), over the degrees of freedom ``dofs``, shape (n,), ascending."""

    dofs: Integers
    stiffness: Floats

    def __add__(self, other: Condensate) -> Condensate:
        """Two bodies joined at their common degrees of freedom."""
        dofs = np.union1d(self.dofs, other.dofs)
        total = np.zeros((len(dofs), len(dofs)))
        here, there = np.searchsorted(dofs, self.dofs), np.searchsorted(dofs, other.dofs)
        total[here[:, None], here] = self.stiffness
        total[there[:, None], there] += other.stiffness
        return Condensate(dofs=dofs, stiffness=total)

    def __mul__(self, factor: float) -> Condensate:
        """The same body of ``factor`` times the modulus."""
        return Condensate(dofs=self.dofs, stiffness=factor * self.stiffness)

    def restrict(self, dofs: Integers) -> Condensate:
        """Eliminate all degrees of freedom but ``dofs``; no force acts on the eliminated ones."""
        selected = np.isin(self.dofs, dofs)
        out, stay = np.flatnonzero(~selected), np.flatnonzero(selected)
        if not out.size:
            return self
        order = np.concatenate([out, stay])
        return Condensate(dofs=self.dofs[stay], stiffness=_eliminate(self.stiffness[order[:, None], order], out.size))


def _eliminate(matrix: Floats, first: int) -> Floats:
    """Schur complement after the ``first`` degrees of freedom are eliminated."""
    # Direct calls of LAPACK: for matrices this small, wrappers cost as much as the computation.
    factor, failed = scipy.linalg.lapack.dpotrf(matrix[:first, :first], lower=1)
    if failed:
        raise np.linalg.LinAlgError("a body's stiffness must be positive definite; it is not")
    # No triangular solve: SciPy's does not release the interpreter lock, and slabs are solved in threads.
    root = scipy.linalg.lapack.dtrtri(factor, lower=1, overwrite_c=1)[0] @ matrix[:first, first:]
    return np.asarray(matrix[first:, first:] - root.T @ root)


EMPTY = Condensate(dofs=np.zeros(0, dtype=np.int64), stiffness=np.zeros((0, 0)))


def condense_layers(
    mesh: LayeredMesh,
    dofs: Integers,
    *,
    retain: Integers,
    young_kpa: Floats,
    poisson: Floats,
    start: Condensate = EMPTY,
) -> Condensate:
    """Condense a body from its first layer to its last.

    ``dofs`` has the index of each displacement, shape (na, nb, 2): `FIXED` where it is zero, equal where tied. The
    result has the indices ``retain`` and those of the last layer's far side. ``young_kpa`` and ``poisson`` have one
    value a layer. ``start`` is a condensed neighbour, attached to the first layers.
    """
    count = (mesh.order + 1) ** 2
    elements = np.stack([mesh.layer(index, mesh.nodes) for index in range(mesh.layers)])
    columns = elements.shape[1]
    matrices = stiffness(
        elements.reshape(-1, count, 2), mesh.order, np.repeat(young_kpa, columns), np.repeat(poisson, columns)
    )
    rims = _without_interior(matrices, mesh.order).reshape(mesh.layers, -1)
    condensed = start.stiffness
    steps = _steps(mesh.order, dofs.shape, dofs.tobytes(), retain.tobytes(), start.dofs.tobytes())
    for step, values in zip(steps, rims, strict=True):
        # The last slot, beyond the matrix, collects fixed displacements.
        flat = np.bincount(step.element_slots, weights=values, minlength=step.size**2 + 1)[:-1].astype(float)
        flat[step.condensed_slots] += condensed.ravel()
        condensed = _eliminate(flat.reshape(step.size, step.size), step.eliminated)
    return Condensate(dofs=steps[-1].dofs, stiffness=condensed)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CondensationStep:
    """Assembly of one element layer into a matrix whose first rows are eliminated."""

    size: int  # number of rows of the matrix
    eliminated: int  # number of eliminated rows
    # Index of each entry of the layer's elements in the flat matrix; ``size**2`` where it is fixed
    element_slots: Integers
    condensed_slots: Integers  # index of each entry of the stiffness from the previous step
    dofs: Integers  # degrees of freedom after the step, ascending


@lru_cache(maxsize=64)
def _steps(
    order: int, shape: tuple[int, int, int], dofs: bytes, retain: bytes, start: bytes
) -> tuple[CondensationStep, ...]:
    """The steps of a condensation; the arrays are bytes, so that they can be cache keys."""
    indices, retained = np.frombuffer(dofs, dtype=np.int64).reshape(shape), np.frombuffer(retain, dtype=np.int64)
    condensed = np.frombuffer(start, dtype=np.int64)
    steps = []
    for index in range((shape[1] - 1) // order):
        layer = layer_of(indices, order, index).reshape(-1, 2 * (order + 1) ** 2)[:, _rim(order)]
        last = indices[:, (index + 1) * order].ravel()
        present = np.union1d(layer, condensed)
        present = present[present != FIXED]
        stays = np.isin(present, np.concatenate([retained, last]))
        ordered = np.concatenate([present[~stays], present[stays]])
        size, position = len(ordered), np.argsort(ordered)
        there = position[np.minimum(np.searchsorted(present, layer), size - 1)]
        slots = there[:, :, None] * size + there[:, None, :]
        fixed = layer == FIXED
        slots[fixed[:, :, None] | fixed[:, None, :]] = size * size
        here = position[np.searchsorted(present, condensed)]
        condensed = present[stays]
        steps.append(
            CondensationStep(
                size=size,
                eliminated=int(np.count_nonzero(~stays)),
                element_slots=slots.ravel(),
                condensed_slots=(here[:, None] * size + here).ravel(),
                dofs=condensed,
            )
        )
    return tuple(steps)


def _without_interior(matrices: Floats, order: int) -> Floats:
    """Eliminate the nodes inside each element."""
    rim = _rim(order)
    inside = np.setdiff1d(np.arange(2 * (order + 1) ** 2), rim)
    if not inside.size:
        return matrices
    cross = matrices[:, inside[:, None], rim]
    core = np.linalg.solve(matrices[:, inside[:, None], inside], cross)
    return np.asarray(matrices[:, rim[:, None], rim] - np.swapaxes(cross, 1, 2) @ core)


@cache
def _rim(order: int) -> Integers:
    """Indices of the displacements on an element's sides."""
    inner = np.zeros((order + 1, order + 1, 2), dtype=bool)
    inner[1:-1, 1:-1] = True
    return np.flatnonzero(~inner.ravel())
