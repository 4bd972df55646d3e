"""Layered meshes of axisymmetric elastic quadrilaterals: their shape, their stiffness, and the contact face.

A mesh is a logical rectangle of quadrilaterals, bent to the body's shape. Direction ``a`` runs along a layer, direction
``b`` from layer to layer; `tsis.mechanics.small_strain.slab` eliminates layer by layer.

Elements have any order, and all stiffness matrices of a mesh are one batch. Nodes are Gauss-Lobatto-Legendre points, so
that high orders stay well conditioned; integration is Gauss-Legendre. Displacements are ordered (u_r, u_z) node by
node. Forces act on the whole ring: they include the factor 2 pi r.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from tsis.errors import InputError

if TYPE_CHECKING:
    from tsis.model.phantom import Inclusion, Phantom
    from tsis.model.probe import Probe


Booleans = NDArray[np.bool]
Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@cache
def lobatto_points(order: int) -> Floats:
    """The ``order + 1`` Gauss-Lobatto-Legendre points on [-1, 1]."""
    inner = legendre.Legendre.basis(order).deriv().roots()
    points = np.concatenate([[-1.0], np.sort(np.real(inner)), [1.0]])
    points.flags.writeable = False
    return points


@cache
def gauss_points(count: int) -> tuple[Floats, Floats]:
    """Gauss-Legendre points and weights on [-1, 1]."""
    points, weights = (np.asarray(part, dtype=float) for part in legendre.leggauss(count))
    points.flags.writeable = weights.flags.writeable = False
    return points, weights


@cache
def _modes(order: int) -> Floats:
    """Legendre coefficients of the polynomials that are 1 at one of the `lobatto_points`, as columns."""
    return np.asarray(np.linalg.inv(legendre.legvander(lobatto_points(order), order)), dtype=float)


def lobatto_values(order: int, x: Floats) -> Floats:
    """Lagrange polynomials on the `lobatto_points` at ``x``, shape (len(x), order + 1)."""
    return np.asarray(legendre.legvander(x, order) @ _modes(order), dtype=float)


def lagrange(nodes: Floats, x: Floats) -> tuple[Floats, Floats]:
    """Lagrange polynomials on ``nodes`` and their derivatives at ``x``; both of shape (len(x), len(nodes))."""
    vandermonde = legendre.legvander(nodes, len(nodes) - 1)
    modes = np.linalg.inv(vandermonde)
    values = legendre.legvander(x, len(nodes) - 1) @ modes
    slopes = np.stack([legendre.legval(x, legendre.legder(mode)) for mode in modes.T], axis=1)
    return np.asarray(values, dtype=float), np.asarray(slopes, dtype=float)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReferenceElement:
    """Shape functions of the reference square at its integration points: arrays of shape (points, nodes)."""

    value: Floats
    slope_a: Floats
    slope_b: Floats
    weight: Floats


@cache
def reference_element(order: int) -> ReferenceElement:
    """The reference square of ``order``; node (i, j) has the index ``i * (order + 1) + j``."""
    x, w = gauss_points(order + 1)
    value, slope = lagrange(lobatto_points(order), x)
    return ReferenceElement(
        value=np.asarray(np.kron(value, value), dtype=float),
        slope_a=np.asarray(np.kron(slope, value), dtype=float),
        slope_b=np.asarray(np.kron(value, slope), dtype=float),
        weight=np.asarray(np.kron(w, w), dtype=float),
    )


def stiffness(nodes: Floats, order: int, young_kpa: Floats, poisson: Floats) -> Floats:
    """Stiffness matrices in mN/mm of a batch of elements.

    Parameters
    ----------
    nodes
        Node positions (r, z) in mm, shape (elements, (order + 1)**2, 2); either orientation.
    order
        Polynomial order.
    young_kpa, poisson
        Material of each element, shape (elements,).

    Returns
    -------
    Array of shape (elements, n, n) with n = 2 (order + 1)**2, symmetric.
    """
    ref, count = reference_element(order), (order + 1) ** 2
    # Slopes of r and z along both directions of the reference square, each of shape (elements, points).
    r_a, z_a = np.moveaxis(ref.slope_a @ nodes, -1, 0)
    r_b, z_b = np.moveaxis(ref.slope_b @ nodes, -1, 0)
    determinant = r_a * z_b - r_b * z_a
    radius = nodes[..., 0] @ ref.value.T
    # Every entry is a product of strains along r, along z and around the hoop; each factor has the weight's root.
    root = np.sqrt(2 * np.pi * radius * np.abs(determinant) * ref.weight)
    scale = root / determinant
    along_r = (scale * z_b)[..., None] * ref.slope_a - (scale * z_a)[..., None] * ref.slope_b
    along_z = (scale * r_a)[..., None] * ref.slope_b - (scale * r_b)[..., None] * ref.slope_a
    hoop = (root / radius)[..., None] * ref.value
    sideways = along_r + hoop
    shear, lame = (constant[:, None, None] for constant in lame_constants(young_kpa, poisson))
    rr, zz = _product(along_r, along_r), _product(along_z, along_z)
    cross = lame * _product(along_z, sideways) + shear * _product(along_r, along_z)  # of u_z (rows) and u_r
    matrix = np.empty((len(nodes), count, 2, count, 2))
    matrix[:, :, 0, :, 0] = lame * _product(sideways, sideways) + shear * (2 * (rr + _product(hoop, hoop)) + zz)
    matrix[:, :, 1, :, 1] = (lame + 2 * shear) * zz + shear * rr
    matrix[:, :, 1, :, 0] = cross
    matrix[:, :, 0, :, 1] = np.swapaxes(cross, 1, 2)
    return matrix.reshape(len(nodes), 2 * count, 2 * count)


def _product(left: Floats, right: Floats) -> Floats:
    """Sums over the integration points of each element."""
    return np.asarray(np.swapaxes(left, 1, 2) @ right)


def lame_constants(young_kpa: Floats, poisson: Floats) -> tuple[Floats, Floats]:
    """Shear modulus and Lame's first constant, kPa."""
    shear = young_kpa / (2 * (1 + poisson))
    return shear, 2 * shear * poisson / (1 - 2 * poisson)


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


FACE_POINTS = 241  # evenly spaced radii of a press field
EDGE_FRACTION = 0.95  # of the radius; outside it the pressure may be singular and its sign is meaningless


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Face:
    """Element boundaries on the face, from the axis to the edge, and the order of the elements at the face."""

    lines: Floats
    order: int

    @property
    def radius_mm(self) -> Floats:
        """Radii of the nodes, ascending, shape (n,)."""
        return refine(self.lines, self.order)

    def interpolation(self, radius_mm: Floats) -> Floats:
        """Matrix from nodal values to values at ``radius_mm``, shape (len(radius_mm), n)."""
        cell = np.clip(np.searchsorted(self.lines, radius_mm, side="right") - 1, 0, len(self.lines) - 2)
        left, size = self.lines[cell], np.diff(self.lines)[cell]
        values = lobatto_values(self.order, 2 * (radius_mm - left) / size - 1)
        matrix = np.zeros((len(radius_mm), (len(self.lines) - 1) * self.order + 1))
        columns = cell[:, None] * self.order + np.arange(self.order + 1)
        np.put_along_axis(matrix, columns, values, axis=1)
        return matrix

    def mass(self) -> Floats:
        """Consistent mass of the face in mm^2: nodal forces (mN) = mass @ nodal pressures (kPa)."""
        x, w = gauss_points(self.order + 2)
        half = np.diff(self.lines) / 2
        radius = (self.lines[:-1, None] + half[:, None] * (x + 1)).ravel()
        weight = 2 * np.pi * radius * (half[:, None] * w).ravel()
        shape = self.interpolation(radius)
        return shape.T @ (weight[:, None] * shape)

    def averages(self, radius_mm: Floats) -> Floats:
        """Matrix from nodal values to means around ``radius_mm``, weighted by area and by distance to the neighbours.

        Means preserve the integral over the face: pressures sum up to the force, although they are singular at the
        edge. ``radius_mm`` ascends from 0 to the edge.
        """
        inside, area = ring_points(np.union1d(radius_mm, self.lines), points=self.order + 2)
        return means(radius_mm, inside, area, self.interpolation(inside))


def ring_points(ends: Floats, *, points: int = 6) -> tuple[Floats, Floats]:
    """Gauss points between the radii ``ends`` and the area of each in mm^2."""
    x, w = gauss_points(points)
    half = np.diff(ends)[:, None] / 2
    inside = (ends[:-1, None] + half * (x + 1)).ravel()
    return inside, 2 * np.pi * inside * (half * w).ravel()


def hats(radius_mm: Floats, at: Floats) -> Floats:
    """Hat functions at ``at``: 1 at one of ``radius_mm``, 0 at the others, linear between, shape (len(at), n)."""
    right = np.clip(np.searchsorted(radius_mm, at), 1, len(radius_mm) - 1)
    fraction = (at - radius_mm[right - 1]) / (radius_mm[right] - radius_mm[right - 1])
    values = np.zeros((len(at), len(radius_mm)))
    rows = np.arange(len(at))
    values[rows, right], values[rows, right - 1] = fraction, 1 - fraction
    return values


def means(radius_mm: Floats, inside: Floats, area: Floats, values: Floats) -> Floats:
    """Means around ``radius_mm`` of ``values`` (points, k) at the integration points ``inside``.

    The means cover the whole face; the values are zero where no integration point lies.
    """
    weighted = area[:, None] * hats(radius_mm, inside)
    return np.asarray(weighted.T @ values / hat_areas(radius_mm)[:, None])


def hat_areas(radius_mm: Floats) -> Floats:
    """Integrals over the face of the functions of `hats`, mm^2, shape (n,)."""
    inside, area = ring_points(radius_mm, points=2)
    return np.asarray(area @ hats(radius_mm, inside))
