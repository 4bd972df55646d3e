"""Probe and slab, condensed to their compliance on the contact face.

By static condensation a body becomes the stiffness of the few displacements common with others. A `Condensate` is a
dense symmetric stiffness over numbered degrees of freedom. Each step adds one element layer and eliminates the
displacements that neither a later layer nor a neighbour needs (Schur complement). The result equals one large sparse
solve but costs only a few dense solves of about a hundred unknowns. The indices of a `CondensationStep` depend only on
the numbering, not on the shape, and are computed once.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.mechanics.mesh import (
    Face,
    Floats,
    Integers,
    LayeredMesh,
    block_outline,
    face_lines,
    graded,
    layer_of,
    mesh_around,
    mesh_inside,
    mesh_rectangle,
    outer_lines,
    stiffness,
    two_sided_lines,
)

if TYPE_CHECKING:
    from tsis.mechanics.mesh import Floats, Integers, Spheroid
    from tsis.model.probe import Probe


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


LARGEST_CELL_MM = 4.0  # an inclusion a centimetre deep bends the face over a centimetre


@dataclass(frozen=True, slots=True, kw_only=True)
class Resolution:
    """Mesh density of the small-strain model.

    Parameters
    ----------
    order
        Polynomial order of the elements.
    edge
        Size of the smallest cell, at the singular edge of the contact, as a fraction of the face's radius.
    growth
        Ratio of neighbouring cells away from the edge.
    largest
        Size of the largest cell on the face as a fraction of its radius.
    below_cells
        Cells along the chest wall under the inclusion.
    ray_layers
        Fewest element layers between the inclusion and the side of its block; small inclusions get more.
    ray_ratio
        Largest ratio of distances from the inclusion's centre across one of these layers.
    sphere_layers
        Element layers inside the inclusion.
    """

    order: int = 5
    edge: float = 0.01
    growth: float = 2.2
    largest: float = 0.2
    below_cells: int = 3
    ray_layers: int = 5
    ray_ratio: float = 2.4
    sphere_layers: int = 1


@lru_cache(maxsize=16)
def face_of(radius_mm: float, resolution: Resolution, central_mm: float = np.inf) -> Face:
    """The contact face of a probe of ``radius_mm``; its cell on the axis is at most ``central_mm`` wide."""
    lines = face_lines(
        radius_mm,
        finest=resolution.edge * radius_mm,
        growth=resolution.growth,
        largest=min(resolution.largest * radius_mm, LARGEST_CELL_MM),
        central=central_mm,
    )
    return Face(lines=lines, order=resolution.order)


@lru_cache(maxsize=16)
def probe_compliance(probe: Probe, face: Face, resolution: Resolution) -> Floats:
    """Normal displacement of the face's nodes by normal forces on them in mm/mN, shape (n, n).

    The glass is bonded and fixed. The contact is frictionless, so tangential displacements of the face are free and
    eliminated. A rim that is bonded to the housing is fixed.
    """
    depth, young, poisson = [np.zeros(1)], [], []
    finest = resolution.edge * probe.radius_mm
    for layer in probe.layers:
        lines = two_sided_lines(
            layer.thickness_mm, finest=finest, growth=resolution.growth, largest=probe.radius_mm / 3
        )
        depth.append(depth[-1][-1] + lines[1:])
        young += [layer.young_kpa] * (len(lines) - 1)
        poisson += [layer.poisson] * (len(lines) - 1)
    flat = mesh_rectangle(face.lines, np.concatenate(depth)[::-1], resolution.order, a_is_radius=True)
    body = LayeredMesh(nodes=_bulged(flat.nodes, probe), order=flat.order)
    count, layers, _ = body.nodes.shape
    dofs = count + np.arange(count * layers * 2).reshape(count, layers, 2)
    dofs[:, -1, 1] = np.arange(count)
    dofs[:, 0] = FIXED  # bonded to the glass
    dofs[0, :, 0] = FIXED  # the axis
    if probe.sides == "bonded":
        dofs[-1] = FIXED
    retain = np.arange(count)
    condensed = condense_layers(
        body, dofs, retain=retain, young_kpa=np.array(young[::-1]), poisson=np.array(poisson[::-1])
    ).restrict(retain)
    compliance = np.zeros((count, count))
    compliance[np.ix_(condensed.dofs, condensed.dofs)] = np.linalg.inv(condensed.stiffness)
    compliance.flags.writeable = False  # shared through the cache
    return compliance


def _bulged(nodes: Floats, probe: Probe) -> Floats:
    """Bend the layers to the dome in proportion to their thickness; the glass stays flat."""
    radius, depth = nodes[..., 0], nodes[..., 1]
    fraction = 1 - probe.sag_mm(radius) / probe.thickness_mm
    return np.stack([radius, probe.thickness_mm - (probe.thickness_mm - depth) * fraction], axis=-1)


class Slab:
    """Tissue of unit modulus around the block that an inclusion may occupy, condensed once.

    It is bonded to a rigid chest wall below. Inclusions are meshed in a block around the axis, of radius ``block_mm``
    or more.
    """

    def __init__(
        self, *, thickness_mm: float, poisson: float, face: Face, block_mm: float, resolution: Resolution
    ) -> None:
        self.thickness_mm, self.poisson, self.face, self.resolution = thickness_mm, poisson, face, resolution
        # At the outer radius the influence of the face has decayed: 4 thicknesses leave 0.1 %.
        edge = float(face.lines[-1])
        outer, finest = max(10 * edge, 4 * thickness_mm), resolution.edge * edge
        beyond = outer_lines(edge, outer, finest=finest, growth=resolution.growth)
        lines = np.concatenate([face.lines, beyond[1:]])
        split = int(np.searchsorted(lines, block_mm))
        self._block_lines, self._far_lines = lines[: split + 1], lines[split:]
        self._depth = graded(thickness_mm, finest, resolution.growth, thickness_mm / 3)

    @property
    def _contacts(self) -> int:
        return len(self.face.radius_mm)

    @cached_property
    def _far(self) -> tuple[Condensate, Integers]:
        """Tissue outside the block, and the degrees of freedom of the block's side, shape (depths, 2)."""
        body, dofs = self._strip(self._far_lines, self._contacts)
        return self._condense(body, dofs, np.arange(self._contacts)), dofs[:, -1]

    @cached_property
    def compliance(self) -> Floats:
        """Compliance of the face in mm/mN, (n, n), on tissue of 1 kPa, on a mesh without inclusion."""
        far, side = self._far
        body, dofs = self._strip(self._block_lines, 1 + max(int(far.dofs.max()), int(side.max())))
        dofs[:, 0] = side
        dofs[:, -1, 0] = FIXED  # the axis
        faces = np.arange(self._contacts)
        return _inverse(self._condense(body, dofs, faces, start=far).restrict(faces))

    def _strip(self, lines: Floats, first: int) -> tuple[LayeredMesh, Integers]:
        """The whole depth between two radii, layered inwards, its displacements numbered from ``first``."""
        body = mesh_rectangle(self._depth, lines[::-1], self.resolution.order, a_is_radius=False)
        depths, radii, _ = body.nodes.shape
        dofs = first + np.arange(depths * radii * 2).reshape(depths, radii, 2)
        dofs[-1] = FIXED  # bonded to the chest wall
        self._number_contacts(body.nodes[0, :, 0], dofs[0, :, 1])
        return body, dofs

    def _condense(
        self,
        body: LayeredMesh,
        dofs: Integers,
        retain: Integers,
        *,
        start: Condensate = EMPTY,
        poisson: float | None = None,
    ) -> Condensate:
        """Condense a part of the slab; all of it has unit modulus."""
        ratio = np.full(body.layers, self.poisson if poisson is None else poisson)
        return condense_layers(body, dofs, retain=retain, young_kpa=np.ones(body.layers), poisson=ratio, start=start)

    def _number_contacts(self, radius: Floats, normal: Integers) -> None:
        """Give the face's nodes among ``radius`` their shared numbers (in place)."""
        distance = np.abs(radius[:, None] - self.face.radius_mm)
        nearest = distance.argmin(axis=1)
        on_face = distance.min(axis=1) < 1e-9 * self.face.lines[-1]
        normal[on_face] = nearest[on_face]

    def _ray_layers(self, boundary: Floats, size: float) -> int:
        extent = np.linalg.norm(boundary - [0.0, self.thickness_mm / 2], axis=1).max()
        return max(self.resolution.ray_layers, int(np.ceil(np.log(extent / size) / np.log(self.resolution.ray_ratio))))

    def with_inclusion(self, shape: Spheroid, *, poisson: float) -> SlabWithInclusion:
        """Mesh an inclusion into the block and condense everything onto the face and the inclusion's surface."""
        far, side = self._far
        order, below = self.resolution.order, self.resolution.below_cells
        boundary = block_outline(self._block_lines, self._depth, self.thickness_mm, order, below_cells=below)
        outer = mesh_around(boundary, shape, order, layers=self._ray_layers(boundary, shape.size))
        count, layers, _ = outer.nodes.shape
        first = 1 + max(int(far.dofs.max()), int(side.max()))
        dofs = first + np.arange(count * layers * 2).reshape(count, layers, 2)
        top = (len(self._block_lines) - 1) * order
        dofs[top : top + len(side), 0] = side
        dofs[top + len(side) - 1 :, 0] = FIXED  # the chest wall
        self._number_contacts(boundary[: top + 1, 0], dofs[: top + 1, 0, 1])
        dofs[[0, -1], :, 0] = FIXED  # the axis
        faces = np.arange(self._contacts)
        around = self._condense(outer, dofs, faces, start=far)
        inner = mesh_inside(boundary, shape, order, layers=self.resolution.sphere_layers)
        core = int(dofs.max()) + 1 + np.arange(count * inner.nodes.shape[1] * 2).reshape(count, -1, 2)
        core[:, 0, 0], core[:, 0, 1] = FIXED, core[0, 0, 1]  # the centre is one node on the axis
        core[[0, -1], :, 0] = FIXED
        core[:, -1] = dofs[:, -1]
        none = np.zeros(0, dtype=np.int64)
        ball = self._condense(inner, core, none, poisson=poisson)
        tissue_ball = ball if poisson == self.poisson else self._condense(inner, core, none)
        return SlabWithInclusion(around=around, ball=ball, tissue_ball=tissue_ball, faces=faces)


@dataclass(frozen=True, kw_only=True, eq=False)
class SlabWithInclusion:
    """A slab of unit modulus with an inclusion of any modulus."""

    around: Condensate
    ball: Condensate
    tissue_ball: Condensate
    faces: Integers

    def compliance(self, contrast: float) -> Floats:
        """Compliance of the face in mm/mN, (n, n), with an inclusion ``contrast`` times as stiff as tissue of 1 kPa."""
        return _inverse((self.around + self.ball * contrast).restrict(self.faces))

    @cached_property
    def tissue_compliance(self) -> Floats:
        """Compliance of tissue without inclusion on the SAME mesh: a baseline without mesh error in the signal."""
        return _inverse((self.around + self.tissue_ball).restrict(self.faces))

    def change(self, contrast: float) -> Floats:
        """Change of the compliance by the inclusion."""
        return self.compliance(contrast) - self.tissue_compliance


def _inverse(body: Condensate) -> Floats:
    return np.asarray(np.linalg.inv(body.stiffness), dtype=float)
