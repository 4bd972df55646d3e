"""Layered meshes: a logical rectangle of quadrilaterals, bent to the body's shape.

Direction ``a`` runs along a layer, direction ``b`` from layer to layer; `condensed` eliminates layer by layer.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from tsis.errors import InputError
from tsis.mechanics._element import Floats, lobatto_points

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model.phantom import Inclusion, Phantom
    from tsis.model.probe import Probe


Scalar = TypeVar("Scalar", bound=np.generic)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LayeredMesh:
    """Nodes (r, z) of a logical rectangle, z downwards from the contact face."""

    nodes: Floats  # positions in mm, shape (na, nb, 2), with na = columns * order + 1 and nb = layers * order + 1
    order: int  # polynomial order of the elements

    @property
    def layers(self) -> int:
        """Number of element layers in direction b."""
        return int(self.nodes.shape[1] - 1) // self.order

    def layer(self, index: int, values: NDArray[Scalar]) -> NDArray[Scalar]:
        """Gather ``values`` (na, nb, ...) by element of one layer; see `layer_of`."""
        return layer_of(values, self.order, index)


def layer_of(values: NDArray[Scalar], order: int, index: int) -> NDArray[Scalar]:
    """Gather ``values`` (na, nb, ...) by element of one layer: shape (columns, (order + 1)**2, ...)."""
    strip = values[:, index * order : (index + 1) * order + 1]
    columns = (values.shape[0] - 1) // order
    gathered = np.stack([strip[column * order : (column + 1) * order + 1] for column in range(columns)])
    return gathered.reshape(columns, (order + 1) ** 2, *values.shape[2:])


def refine(lines: Floats, order: int) -> Floats:
    """Node coordinates of the intervals between ``lines``: Gauss-Lobatto points with common end points."""
    unit = (lobatto_points(order)[:-1] + 1) / 2
    inner = lines[:-1, None] + np.diff(lines)[:, None] * unit
    return np.append(inner.ravel(), lines[-1])


def graded(length: float, first: float, ratio: float, largest: float) -> Floats:
    """Lines from 0 to ``length`` whose spacing starts near ``first`` and grows by ``ratio`` up to ``largest``."""
    steps = [first]
    while sum(steps) < length:
        steps.append(min(steps[-1] * ratio, largest))
    lines = np.concatenate([[0.0], np.cumsum(steps)])
    return np.asarray(lines * (length / lines[-1]))


def face_lines(edge: float, *, finest: float, growth: float, largest: float, central: float = np.inf) -> Floats:
    """Radial element boundaries from the axis to the edge of the face, finer towards the singular edge.

    ``central`` is the size of the cell at the axis where a shallow inclusion needs a finer cell than ``largest``.
    """
    lines = np.asarray(edge - graded(edge, finest, growth, largest)[::-1])
    lines[0] = 0.0
    if central >= lines[1]:
        return lines
    return np.concatenate([graded(float(lines[1]), central, growth, largest)[:-1], lines[1:]])


def outer_lines(edge: float, outer: float, *, finest: float, growth: float) -> Floats:
    """Radial element boundaries from the edge of the face to the slab's outer radius."""
    return edge + graded(outer - edge, finest, growth, outer / 4)


def two_sided_lines(thickness: float, *, finest: float, growth: float, largest: float) -> Floats:
    """Element boundaries of a layer, refined towards both of its faces."""
    half = graded(thickness / 2, finest, growth, largest)
    return np.concatenate([half, thickness - half[-2::-1]])


def mesh_rectangle(a: Floats, b: Floats, order: int, *, a_is_radius: bool) -> LayeredMesh:
    """A straight mesh from its element boundaries in the two directions."""
    grid = np.stack(np.meshgrid(refine(a, order), refine(b, order), indexing="ij"), axis=-1)
    return LayeredMesh(nodes=grid if a_is_radius else grid[..., ::-1], order=order)


@dataclass(frozen=True, slots=True, kw_only=True)
class Spheroid:
    """A body of revolution on the axis, its centre below the face; lengths in mm."""

    centre_depth: float
    half_width: float
    half_height: float

    @property
    def size(self) -> float:
        """Radius of the sphere of the same volume."""
        return float(np.cbrt(self.half_width**2 * self.half_height))

    def surface(self, boundary: Floats) -> Floats:
        """Points where rays from the centre to the points (r, z) of ``boundary`` cross the surface."""
        centre = np.array([0.0, self.centre_depth])
        rays = boundary - centre
        fraction = 1 / np.hypot(rays[:, 0] / self.half_width, rays[:, 1] / self.half_height)
        return np.asarray(centre + fraction[:, None] * rays)


def block_outline(top: Floats, side: Floats, bottom: float, order: int, *, below_cells: int) -> Floats:
    """Outer nodes of the block around an inclusion: along the face, down the side, back along the chest wall.

    ``top`` and ``side`` are the element boundaries along the face and down to the wall at ``bottom``.
    """
    edge, radius, depth = top[-1], refine(top, order), refine(side, order)
    back = refine(np.linspace(edge, 0.0, below_cells + 1), order)
    return np.concatenate(
        [
            np.column_stack([radius, np.zeros_like(radius)]),
            np.column_stack([np.full_like(depth, edge), depth])[1:],
            np.column_stack([back, np.full_like(back, bottom)])[1:],
        ]
    )


def mesh_around(boundary: Floats, spheroid: Spheroid, order: int, *, layers: int) -> LayeredMesh:
    """Mesh between an outer ``boundary`` (b = 0) and a spheroid (last b), along rays from its centre.

    ``boundary`` has the outer nodes (r, z) from the axis on the face to the axis below, shape (na, 2). The element
    layers become thinner towards the spheroid.
    """
    surface = spheroid.surface(boundary)
    # Equal ratios of distance from the centre suit fields that decay with its powers, for a spheroid of any size.
    extent, size = np.linalg.norm(boundary - [0.0, spheroid.centre_depth], axis=1).max(), spheroid.size
    distance = size * (extent / size) ** (np.arange(layers + 1) / layers)
    fraction = refine((distance - size) / (extent - size), order)[::-1]
    nodes = surface[:, None] + fraction[None, :, None] * (boundary - surface)[:, None]
    return LayeredMesh(nodes=nodes, order=order)


def mesh_inside(boundary: Floats, spheroid: Spheroid, order: int, *, layers: int) -> LayeredMesh:
    """Mesh of the spheroid itself, from its centre (b = 0) to its surface, on the same rays as `mesh_around`."""
    centre = np.array([0.0, spheroid.centre_depth])
    fraction = refine(np.linspace(0.0, 1.0, layers + 1), order)
    surface = spheroid.surface(boundary)
    return LayeredMesh(nodes=centre + fraction[None, :, None] * (surface - centre)[:, None], order=order)


def sphere_on_axis(diameter_mm: float, depth_mm: float) -> Spheroid:
    """The sphere whose top lies ``depth_mm`` under the skin."""
    radius = diameter_mm / 2
    return Spheroid(centre_depth=depth_mm + radius, half_width=radius, half_height=radius)


def block_radius_mm(probe: Probe, thickness_mm: float, width_mm: float = 0.0) -> float:
    """Radius of the block around the axis that has its own mesh for inclusions of up to ``width_mm``."""
    return max(min(0.8 * probe.radius_mm, thickness_mm), 0.65 * width_mm)


def central_cell_mm(width_mm: float, depth_mm: float, centre_mm: float) -> float:
    """Largest cell of the face that resolves the effect of an inclusion under it.

    Its width is about the depth of the inclusion's centre, or the gap over a large inclusion close to the skin.
    """
    return 0.6 * min(centre_mm, depth_mm + float(np.sqrt(width_mm * depth_mm)))


def shape_on_axis(phantom: Phantom) -> Spheroid:
    """The phantom's only inclusion as a body of revolution; others raise `InputError`."""
    inclusion: Inclusion | None = phantom.inclusion
    if inclusion is None or not phantom.is_axisymmetric:
        raise InputError(
            "inclusion must be one sphere or spheroid on the probe's axis (offset_mm (0, 0), semi_axes_mm x = y, "
            f"no more_inclusions) for this model; got {phantom.inclusions!r:.200}; press_solid takes any"
        )
    half_width, _, half_height = inclusion.half_axes_mm
    return Spheroid(centre_depth=inclusion.centre_depth_mm, half_width=half_width, half_height=half_height)


def mechanical_content(probe: Probe) -> dict[str, Any]:
    """All values of a probe that its presses depend on, as JSON values."""
    content = asdict(replace(probe.unlit(), name="", assumed=()))
    for layer in content["layers"]:
        del layer["refractive_index"]
    return content
