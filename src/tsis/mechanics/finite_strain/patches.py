"""Meshes of the probe and of the slab: patches of quadrilaterals welded together, one list of nodes a body.

The probe's rim is rounded, so that contact has a direction everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.mechanics.mesh import (
    LayeredMesh,
    block_outline,
    face_lines,
    graded,
    layer_of,
    mesh_around,
    mesh_inside,
    mesh_rectangle,
    outer_lines,
    refine,
    shape_on_axis,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.mechanics.mesh import Booleans, Floats, Integers
    from tsis.model.phantom import Phantom
    from tsis.model.probe import Layer, Probe


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
    pairs = scipy.spatial.cKDTree(positions).query_pairs(SAME_POINT_MM, output_type="ndarray")
    links = scipy.sparse.coo_array(
        (np.ones(len(pairs), dtype=bool), (pairs[:, 0], pairs[:, 1])), shape=(len(positions),) * 2
    )
    count, label = scipy.sparse.csgraph.connected_components(links, directed=False)
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


@dataclass(frozen=True, slots=True, kw_only=True)
class RoundedProbe:
    """A probe with a rounded rim of radius ``fillet_mm``; see `rounded`.

    Positions on the outline are arc lengths in mm along the face of the flat probe, from the axis over the rim up the
    side.
    """

    probe: Probe
    fillet_mm: float

    @property
    def radius_mm(self) -> float:
        """Radius of the face, the rim included, mm."""
        return self.probe.radius_mm

    @property
    def middle_mm(self) -> float:
        """Arc length of the middle of the rim, mm."""
        return self.radius_mm - self.fillet_mm * (1 - np.pi / 4)

    def points(self, arc_mm: Floats) -> Floats:
        """Points (r, z) of the undeformed outline, z downwards from the apex, mm, shape (k, 2)."""
        return self.bulge(self.flat_points(arc_mm))

    def flat_points(self, arc_mm: Floats) -> Floats:
        """Points of the outline before the face is domed."""
        flat, fillet = self.radius_mm - self.fillet_mm, self.fillet_mm
        turn = np.clip((arc_mm - flat) / fillet, 0.0, np.pi / 2)
        up = np.maximum(arc_mm - flat - fillet * np.pi / 2, 0.0)
        return np.column_stack([np.minimum(arc_mm, flat) + fillet * np.sin(turn), -fillet * (1 - np.cos(turn)) - up])

    def arc_at(self, radius_mm: Floats) -> Floats:
        """Arc lengths of the face's material points at ``radius_mm``, mm."""
        flat = self.radius_mm - self.fillet_mm
        beyond = np.clip((radius_mm - flat) / self.fillet_mm, 0.0, 1.0)
        return np.asarray(np.minimum(radius_mm, flat) + self.fillet_mm * np.arcsin(beyond))

    def radius_at(self, arc_mm: Floats) -> Floats:
        """Material radius at arc lengths on the outline, mm."""
        return self.flat_points(arc_mm)[:, 0]

    def bulge(self, nodes: Floats) -> Floats:
        """Nodes (r, z) of a flat probe after its layers bulge in proportion, the glass staying flat."""
        thickness = self.probe.thickness_mm
        fraction = (thickness - self.probe.sag_mm(np.minimum(nodes[:, 0], self.radius_mm))) / thickness
        return np.column_stack([nodes[:, 0], (nodes[:, 1] + thickness) * fraction - thickness])


def rounded(probe: Probe, fillet_mm: float) -> RoundedProbe:
    """Round the rim with ``fillet_mm``, or less on thin first layers (a quarter) and small faces (a tenth)."""
    return RoundedProbe(probe=probe, fillet_mm=min(fillet_mm, probe.layers[0].thickness_mm / 4, probe.radius_mm / 10))


SLIDING_MM = 2.0  # width of the fine strip of skin inside the rim; large loads drag it around the rim
SLIDING_FRACTION = 0.3  # of the face's radius at most
NARROW = 1.25  # of the face's radius: widest inclusion whose block leaves the tissue under the rim alone
WIDE_LAYERS = 2  # in the block around a wider one, over those around a narrow one


@dataclass(frozen=True, slots=True, kw_only=True)
class FiniteResolution:
    """Mesh density of the finite-strain model.

    Parameters
    ----------
    order
        Polynomial order of the elements; at least 3.
    fillet_mm
        Radius of the probe's rounded rim; less on thin first layers and small faces. A sharp rim has no solution.
    rim_mm
        Size of the smallest cells, at the edge of the face.
    growth
        Ratio of neighbouring cells away from the edge.
    largest
        Size of the largest cell on a flat face as a fraction of its radius; a domed face has half of it.
    ray_layers, sphere_layers
        Element layers around and inside the inclusion; see `SlabLines.layers`.
    """

    order: int = 4
    fillet_mm: float = 0.5
    rim_mm: float = 0.4
    growth: float = 2.2
    largest: float = 0.2
    ray_layers: int = 4
    sphere_layers: int = 1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MeshedProbe:
    """The probe's mesh."""

    solid: Solid  # nodes with z downwards, the face's apex at z = 0 and the glass at minus the thickness
    face: Integers  # nodes of the face from the axis over the rounded rim up the side, in order
    arc_mm: Floats  # arc length of the face's nodes on the outline, mm
    glass: Integers  # nodes on the glass
    side: Integers  # nodes on the straight side, without the rounded rim


def mesh_probe(shape: RoundedProbe, face_lines: Floats, resolution: FiniteResolution) -> MeshedProbe:
    """Mesh a probe in three patches that meet inside its rounded rim.

    ``face_lines`` are the element boundaries as fractions of the arc from the axis to the middle of the rounded rim.
    """
    order, probe, fillet, radius = resolution.order, shape.probe, shape.fillet_mm, shape.radius_mm
    frame = 2 * fillet  # thickness of the strip along face and side
    corner = radius - frame
    depth = graded(frame, 0.7 * resolution.rim_mm, resolution.growth, frame)
    inwards = refine(depth / frame, order)
    # Along the face: from the axis to the middle of the rounded rim; the inner line ends at the corner of the strip.
    along = refine(face_lines, order)
    start = shape.middle_mm
    outer = shape.flat_points(along * start)
    inner = np.column_stack([along * corner, np.full_like(along, -frame)])
    below = _shaped(shape, _between(outer, inner, inwards), order)
    # Along the side: one piece for each layer of the probe.
    ends = np.cumsum([layer.thickness_mm for layer in probe.layers])
    inner_ends, outer_ends = np.concatenate([[frame], ends]), np.concatenate([[0.0], ends - fillet * (1 - np.pi / 4)])
    pieces = [
        graded(1.0, min(1.0, max(resolution.rim_mm, 0.25 * size) / size), resolution.growth, 1.0)
        for size in np.diff(inner_ends)
    ]
    counts = [len(piece) - 1 for piece in pieces]
    fractions = [refine(piece, order) for piece in pieces]
    up = _chain(inner_ends, fractions)
    side_inner = np.column_stack([np.full_like(up, corner), -up])
    side_arc = start + _chain(outer_ends, fractions)
    side_outer = shape.flat_points(side_arc)
    # Transposed, so that direction b runs from layer to layer.
    beside = _shaped(shape, np.swapaxes(_between(side_outer, side_inner, inwards), 0, 1), order)
    core = _shaped(shape, np.stack(np.meshgrid(along * corner, -up, indexing="ij"), axis=-1), order)
    young = np.repeat([layer.young_kpa for layer in probe.layers], counts)
    poisson = np.repeat([layer.poisson for layer in probe.layers], counts)
    solid = weld(
        [
            MeshPatch.uniform(below, probe.layers[0]),
            MeshPatch(mesh=beside, young_kpa=young, poisson=poisson),
            MeshPatch(mesh=core, young_kpa=young, poisson=poisson),
        ]
    )
    face_numbers, side_numbers, core_numbers = solid.patches
    outer_side = side_numbers[0]
    flat = solid.nodes[outer_side, 0] > radius - 1e-9
    return MeshedProbe(
        solid=solid,
        face=np.concatenate([face_numbers[:, 0], outer_side[1 : counts[0] * order + 1]]),
        arc_mm=np.concatenate([along * start, side_arc[1 : counts[0] * order + 1]]),
        glass=np.unique(np.concatenate([core_numbers[:, -1], side_numbers[:, -1]])),
        side=outer_side[flat],
    )


def _shaped(shape: RoundedProbe, nodes: Floats, order: int) -> LayeredMesh:
    return LayeredMesh(nodes=shape.bulge(nodes.reshape(-1, 2)).reshape(nodes.shape), order=order)


def _between(outer: Floats, inner: Floats, fraction: Floats) -> Floats:
    return np.asarray(outer[:, None] + fraction[None, :, None] * (inner - outer)[:, None])


def _chain(ends: Floats, fractions: list[Floats]) -> Floats:
    """Node coordinates of pieces between ``ends``, each divided by its ``fractions``; common nodes once."""
    parts = [low + fraction * (high - low) for low, high, fraction in zip(ends[:-1], ends[1:], fractions, strict=True)]
    return np.concatenate([parts[0], *(part[1:] for part in parts[1:])])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MeshedSlab:
    """The slab's mesh."""

    solid: Solid  # nodes with z downwards from the skin
    skin: Integers  # nodes of the skin that the probe can touch, from the axis outwards, in order
    inclusion: Booleans  # mask of the elements in the inclusion


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SlabLines:
    """Element boundaries of a slab: two slabs meshed on the same lines have the same topology."""

    radial_mm: Floats  # from the axis to the outer radius
    depth: Floats  # from the skin to the chest wall as fractions of the thickness
    split: int  # index of the radial line around the block of the inclusion
    extent: int  # index of the radial line that ends the skin in contact
    layers: int  # of elements around the inclusion


def slab_lines(phantom: Phantom, probe: Probe, resolution: FiniteResolution) -> SlabLines:
    """Element boundaries that suit a slab and its inclusion.

    The block around an inclusion wider than `NARROW` takes in the tissue under the rim, so it has more layers: in four,
    pressures near the rim come out up to 11 % of the signal's peak wrong.
    """
    thickness, edge = phantom.thickness_mm, probe.radius_mm
    largest = resolution.largest * probe.radius_mm
    cells = int(np.ceil(min(SLIDING_MM, SLIDING_FRACTION * probe.radius_mm) / resolution.rim_mm))
    fine = edge - resolution.rim_mm * np.arange(cells + 1)[::-1]
    coarse = face_lines(
        float(fine[0]), finest=resolution.rim_mm * resolution.growth, growth=resolution.growth, largest=largest
    )
    inside = np.concatenate([coarse[:-1], fine])
    outer = max(8 * probe.radius_mm, 3.2 * thickness)
    beyond = outer_lines(edge, outer, finest=resolution.rim_mm, growth=resolution.growth)
    lines = np.concatenate([inside, beyond[1:]])
    depth = graded(thickness, 1.5 * resolution.rim_mm, resolution.growth, thickness / 4)
    width = 0.0 if phantom.inclusion is None else shape_on_axis(phantom).half_width
    return SlabLines(
        radial_mm=lines,
        depth=depth / thickness,
        split=int(np.searchsorted(lines, max(0.75 * probe.radius_mm, 1.3 * width))),
        extent=int(np.searchsorted(lines, edge + 2 * resolution.rim_mm)),
        layers=resolution.ray_layers * (WIDE_LAYERS if 2 * width > NARROW * edge else 1),
    )


def mesh_slab(
    phantom: Phantom, probe: Probe, resolution: FiniteResolution, lines: SlabLines | None = None
) -> MeshedSlab:
    """Mesh a slab with the inclusion of ``phantom``, or without any, on its own ``lines`` or on those given."""
    order = resolution.order
    lines = slab_lines(phantom, probe, resolution) if lines is None else lines
    radial, depth, extent, split = lines.radial_mm, lines.depth * phantom.thickness_mm, lines.extent, lines.split
    if phantom.inclusion is None:
        solid = weld([MeshPatch.uniform(mesh_rectangle(radial, depth, order, a_is_radius=True), phantom)])
        return MeshedSlab(
            solid=solid,
            skin=solid.patches[0][: extent * order + 1, 0],
            inclusion=np.zeros(len(solid.cells), dtype=bool),
        )
    spheroid = shape_on_axis(phantom)
    near, far = radial[: split + 1], radial[split:]
    boundary = block_outline(near, depth, depth[-1], order, below_cells=max(2, len(near) // 2))
    around = mesh_around(boundary, spheroid, order, layers=lines.layers)
    within = mesh_inside(boundary, spheroid, order, layers=resolution.sphere_layers)
    beyond_block = mesh_rectangle(far, depth, order, a_is_radius=True)
    solid = weld([MeshPatch.uniform(body, phantom) for body in (around, within, beyond_block)])
    columns = (len(boundary) - 1) // order
    member = np.zeros(len(solid.cells), dtype=bool)
    member[columns * around.layers : columns * (around.layers + within.layers)] = True
    skin = np.concatenate(
        [solid.patches[0][: split * order + 1, 0], solid.patches[2][1 : (extent - split) * order + 1, 0]]
    )
    return MeshedSlab(solid=solid, skin=skin, inclusion=member)
