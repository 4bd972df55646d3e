"""Layered meshes: a logical rectangle of quadrilaterals, bent to the body's shape.

Direction ``a`` runs along a layer, direction ``b`` from layer to layer; `condensed` eliminates layer by layer.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from tsis.mechanics.element import lobatto_points

if TYPE_CHECKING:
    from numpy.typing import NDArray


Scalar = TypeVar("Scalar", bound=np.generic)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LayeredMesh:
    """Nodes (r, z) of a logical rectangle, z downwards from the contact face.

    Attributes
    ----------
    nodes
        Positions in mm, shape (na, nb, 2), with na = columns * order + 1 and nb = layers * order + 1.
    order
        Polynomial order of the elements.
    """

    nodes: NDArray[np.float64]
    order: int

    @property
    def layers(self) -> int:
        """Number of element layers in direction b."""
        return int(self.nodes.shape[1] - 1) // self.order

    def layer(self, index: int, values: NDArray[Scalar]) -> NDArray[Scalar]:
        """Gather ``values`` (na, nb, ...) by element of one layer: shape (columns, (order + 1)**2, ...)."""
        p = self.order
        strip = values[:, index * p : index * p + p + 1]
        columns = (self.nodes.shape[0] - 1) // p
        gathered = np.stack([strip[column * p : column * p + p + 1] for column in range(columns)])
        return gathered.reshape(columns, (p + 1) ** 2, *values.shape[2:])


def refine(lines: NDArray[np.float64], order: int) -> NDArray[np.float64]:
    """Node coordinates of the intervals between ``lines``: Gauss-Lobatto points in each, ends shared."""
    unit = (lobatto_points(order)[:-1] + 1) / 2
    inner = lines[:-1, None] + np.diff(lines)[:, None] * unit
    return np.append(inner.ravel(), lines[-1])


def graded(length: float, first: float, ratio: float, largest: float) -> NDArray[np.float64]:
    """Lines from 0 to ``length`` whose spacing starts near ``first`` and grows by ``ratio`` up to ``largest``."""
    steps = [first]
    while sum(steps) < length:
        steps.append(min(steps[-1] * ratio, largest))
    lines = np.concatenate([[0.0], np.cumsum(steps)])
    return np.asarray(lines * (length / lines[-1]))


def face_lines(edge: float, *, finest: float, growth: float, largest: float) -> NDArray[np.float64]:
    """Radial element boundaries from the axis to the edge of the face, finer towards the singular edge."""
    return edge - graded(edge, finest, growth, largest)[::-1]


def beyond_lines(edge: float, outer: float, *, finest: float, growth: float) -> NDArray[np.float64]:
    """Radial element boundaries from the edge of the face to where the slab is cut off."""
    return edge + graded(outer - edge, finest, growth, outer / 4)


def both_ends(thickness: float, *, finest: float, growth: float, largest: float) -> NDArray[np.float64]:
    """Element boundaries of a layer, refined towards both of its faces."""
    half = graded(thickness / 2, finest, growth, largest)
    return np.concatenate([half, thickness - half[-2::-1]])


def rectangle(a: NDArray[np.float64], b: NDArray[np.float64], order: int, *, a_is_radius: bool) -> LayeredMesh:
    """A straight mesh from its element boundaries in the two directions."""
    grid = np.stack(np.meshgrid(refine(a, order), refine(b, order), indexing="ij"), axis=-1)
    return LayeredMesh(nodes=grid if a_is_radius else grid[..., ::-1], order=order)


def around_sphere(
    boundary: NDArray[np.float64], centre_depth: float, radius: float, order: int, *, layers: int
) -> LayeredMesh:
    """Mesh between an outer ``boundary`` (b = 0) and a sphere on the axis (last b), along rays from its centre.

    Parameters
    ----------
    boundary
        Outer nodes (r, z) from the axis on the face to the axis below, shape (na, 2).
    centre_depth, radius
        The sphere, mm.
    layers
        Number of element layers, thinner towards the sphere.
    """
    sphere = _on_sphere(boundary, centre_depth, radius)
    # Equal ratios of distance from the centre suit fields that decay with powers of it, however small the sphere.
    reach = np.linalg.norm(boundary - [0.0, centre_depth], axis=1).max()
    distance = radius * (reach / radius) ** (np.arange(layers + 1) / layers)
    fraction = refine((distance - radius) / (reach - radius), order)[::-1]
    nodes = sphere[:, None] + fraction[None, :, None] * (boundary - sphere)[:, None]
    return LayeredMesh(nodes=nodes, order=order)


def inside_sphere(
    boundary: NDArray[np.float64], centre_depth: float, radius: float, order: int, *, layers: int
) -> LayeredMesh:
    """Mesh of the sphere itself, from its centre (b = 0) to its surface, on the same rays as `around_sphere`."""
    centre = np.array([0.0, centre_depth])
    fraction = refine(np.linspace(0.0, 1.0, layers + 1), order)
    sphere = _on_sphere(boundary, centre_depth, radius)
    return LayeredMesh(nodes=centre + fraction[None, :, None] * (sphere - centre)[:, None], order=order)


def _on_sphere(boundary: NDArray[np.float64], centre_depth: float, radius: float) -> NDArray[np.float64]:
    rays = boundary - np.array([0.0, centre_depth])
    return np.asarray([0.0, centre_depth] + radius * rays / np.linalg.norm(rays, axis=1)[:, None])
