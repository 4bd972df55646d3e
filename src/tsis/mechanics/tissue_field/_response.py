"""Response of a press that covers the face to small changes of the tissue's modulus at each point.

The field phi is the change of the logarithm of the modulus. Strains of unit forces on the face are the adjoint: a
change of the stiffness at a point changes the face's displacement by ``-phi strain : stress`` of the press without it,
and the contact answers with the compliance of both bodies, at fixed force. A round press and harmonic m of the field
give harmonic m of the response.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.mechanics._face import Face
from tsis.mechanics._mesh import face_lines, graded, mesh_rectangle, outer_lines, two_sided_lines
from tsis.mechanics.tissue_field._fourier import AXIAL, RADIAL, directions, element_points, solve_body
from tsis.model.press import MN_PER_N

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.mechanics._element import Booleans, Floats, Integers
    from tsis.mechanics._mesh import LayeredMesh
    from tsis.mechanics.tissue_field._fourier import ElementPoints, HarmonicBody
    from tsis.model.probe import Probe


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldMesh:
    """Mesh of probe and tissue.

    Parameters
    ----------
    order
        Polynomial order of the elements.
    finest, largest
        Smallest and largest cell on the face, as fractions of its radius.
    growth
        Ratio of neighbouring cells.
    points
        Number of radii of the profiles, evenly spaced from the axis to the edge.
    """

    order: int = 3
    finest: float = 0.04
    largest: float = 0.12
    growth: float = 1.7
    points: int = 61


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FieldResponse:
    """Response of the profiles to one harmonic of the field, by parts of a press: shape + force * unit.

    Attributes
    ----------
    pressure_kpa, face_displacement_mm
        Change of the profile by a unit of the field at each point, shape (2, radii, points): of the unit press per
        newton, and of the press by the dome's shape, zero for a flat face.
    radius_mm, depth_mm
        Coordinates of the points, shape (points,).
    """

    pressure_kpa: Floats
    face_displacement_mm: Floats
    radius_mm: Floats
    depth_mm: Floats


class TissueFieldResponse:
    """One probe on one slab, with a sphere on the axis or without inclusion.

    Parameters
    ----------
    probe
        The probe; its face is covered.
    young_kpa, poisson, thickness_mm
        The tissue.
    inclusion
        Diameter, depth and modulus of a sphere of the tissue's Poisson's ratio, or None.
    layer
        Thickness in mm of a superficial layer and its modulus over the tissue's, or None; the inclusion has none.
    mesh
        Mesh density; the sphere's surface need not follow it.
    """

    def __init__(
        self,
        probe: Probe,
        *,
        young_kpa: float,
        thickness_mm: float,
        poisson: float,
        inclusion: tuple[float, float, float] | None = None,
        layer: tuple[float, float] | None = None,
        mesh: FieldMesh | None = None,
    ) -> None:
        self.probe, self.mesh = probe, mesh or FieldMesh()
        self._young_kpa, self._poisson, self._inclusion = young_kpa, poisson, inclusion
        self._layer = (0.0, 1.0) if layer is None else layer
        self.face = _face(probe, self.mesh)
        self.radius_mm = np.linspace(0.0, probe.radius_mm, self.mesh.points)
        self._slab = _slab_mesh(probe, thickness_mm, self.mesh, self._layer[0])
        self._cached: dict[int, tuple[HarmonicBody, Floats]] = {}

    def response(self, harmonic: int) -> FieldResponse:
        """Response to harmonic 0, the field's mean around the axis, or to ``cos(harmonic * angle)``."""
        tissue, probe_compliance = self._bodies(harmonic)
        round_stress = self._bodies(0)[0].stress @ self._round_forces
        # The displacement of the face by the field, without the minus sign: stiffer tissue is pressed in less.
        moved = np.einsum("gsn,gsp->png", tissue.strain, round_stress, optimize=True)
        inverse = np.linalg.inv(tissue.compliance + probe_compliance)
        if harmonic == 0:  # at fixed force
            row_sums = inverse.sum(axis=1)
            inverse = inverse - np.outer(row_sums, row_sums) / row_sums.sum()
        pressure, displacement = self._outputs(harmonic, probe_compliance)
        return FieldResponse(
            pressure_kpa=pressure @ inverse @ moved,
            face_displacement_mm=displacement @ inverse @ moved,
            radius_mm=tissue.radius_mm,
            depth_mm=tissue.depth_mm,
        )

    def press(self) -> tuple[Floats, Floats]:
        """Pressures in kPa and displacements in mm at the radii, shape (2, radii): unit press per newton, and shape."""
        pressure, displacement = self._outputs(0, self._bodies(0)[1])
        return (pressure @ self._round_forces).T, (displacement @ self._round_forces).T

    def tilt(self) -> tuple[Floats, Floats]:
        """Change of pressure in kPa and displacement in mm at the radii by a rotation of the probe, times the cosine.

        Shape (radii,) each: per radian, where the face stays covered and smooth.
        """
        tissue, probe_compliance = self._bodies(1)
        forces = np.linalg.solve(tissue.compliance + probe_compliance, self.face.radius_mm[1:])
        pressure, displacement = self._outputs(1, probe_compliance)
        return pressure @ forces, displacement @ forces

    def points_mm(self, harmonic: int) -> tuple[Floats, Floats]:
        """Radius and depth of the points, as in `response`."""
        points = _points(self._slab, harmonic)
        return points.radius_mm.ravel(), points.depth_mm.ravel()

    @cached_property
    def _round_forces(self) -> Floats:
        """Nodal forces in mN of the unit press and of the press by the dome's shape, shape (n, 2)."""
        tissue, probe_compliance = self._bodies(0)
        inverse = np.linalg.inv(tissue.compliance + probe_compliance)
        travel = inverse.sum(axis=1)
        travel /= travel.sum()
        shape = -inverse @ self.probe.sag_mm(self.face.radius_mm)
        return np.column_stack([MN_PER_N * travel, shape - travel * shape.sum()])

    def _outputs(self, harmonic: int, probe_compliance: Floats) -> tuple[Floats, Floats]:
        """Matrices from nodal forces to pressures and displacements at the radii."""
        nodes = slice(None) if harmonic == 0 else slice(1, None)  # nothing but a round pressure acts on the axis
        mass = self.face.mass()[nodes, nodes] * (1.0 if harmonic == 0 else 0.5)
        averages = self.face.averages(self.radius_mm)[:, nodes]
        return averages @ np.linalg.inv(mass), self.face.interpolation(self.radius_mm)[:, nodes] @ probe_compliance

    def _bodies(self, harmonic: int) -> tuple[HarmonicBody, Floats]:
        """The tissue under a harmonic, and the probe's compliance."""
        if harmonic not in self._cached:
            points = _points(self._slab, harmonic)
            thickness, factor = self._layer
            young = np.where(points.depth_mm < thickness, factor, 1.0) * self._young_kpa
            if self._inclusion is not None:
                young = np.where(self.inside(points.radius_mm, points.depth_mm), self._inclusion[2], young)
            tissue = solve_body(
                points,
                young,
                np.full_like(young, self._poisson),
                free=_free(self._slab.shape, harmonic, fixed_side=False),
                loaded=_loaded(self._slab.shape, len(self.face.radius_mm), harmonic),
            )
            self._cached[harmonic] = tissue, _probe_compliance(self.probe, self.mesh, harmonic)
        return self._cached[harmonic]

    def inside(self, radius_mm: Floats, depth_mm: Floats) -> Booleans:
        """Whether points lie in the inclusion, where the field is zero."""
        if self._inclusion is None:
            return np.zeros(np.shape(radius_mm), dtype=bool)
        diameter, depth, _ = self._inclusion
        return np.asarray(radius_mm**2 + (depth_mm - depth - diameter / 2) ** 2 < (diameter / 2) ** 2)


@dataclass(frozen=True, slots=True)
class RectangleMesh:
    """A slab by its element boundaries: hashable, so that its operators are computed once."""

    radii: tuple[float, ...]
    depths: tuple[float, ...]
    order: int

    @property
    def shape(self) -> tuple[int, int]:
        """Nodes along the radius and along the depth."""
        return self.order * (len(self.radii) - 1) + 1, self.order * (len(self.depths) - 1) + 1

    def mesh(self) -> LayeredMesh:
        """The mesh; its first index runs along the radius."""
        return mesh_rectangle(np.array(self.radii), np.array(self.depths), self.order, a_is_radius=True)


@lru_cache(maxsize=16)
def _points(slab: RectangleMesh, harmonic: int) -> ElementPoints:
    return element_points(slab.mesh(), harmonic)


@lru_cache(maxsize=8)
def _face(probe: Probe, mesh: FieldMesh) -> Face:
    edge = probe.radius_mm
    lines = face_lines(edge, finest=mesh.finest * edge, growth=mesh.growth, largest=mesh.largest * edge)
    return Face(lines=lines, order=mesh.order)


def _slab_mesh(probe: Probe, thickness_mm: float, mesh: FieldMesh, layer_mm: float) -> RectangleMesh:
    edge, face = probe.radius_mm, _face(probe, mesh)
    beyond = outer_lines(edge, max(5 * edge, 3 * thickness_mm), finest=mesh.finest * edge, growth=mesh.growth)
    depths = np.union1d(graded(thickness_mm, mesh.finest * edge, 1.35, 0.25 * edge), layer_mm)
    return RectangleMesh((*face.lines.tolist(), *beyond[1:].tolist()), tuple(depths.tolist()), mesh.order)


def _free(shape: tuple[int, int], harmonic: int, *, fixed_side: bool) -> Booleans:
    """Unknowns that are free: the far side is bonded, and symmetry holds the axis."""
    free = np.ones((*shape, directions(harmonic)), dtype=bool)
    if harmonic == 0:
        free[0, :, RADIAL] = False
    elif harmonic == 1:
        free[0, :, AXIAL] = False  # the axis may shift sideways
    else:
        free[0] = False
    free[:, -1] = False
    if fixed_side:
        free[-1] = False
    return free.ravel()


def _loaded(shape: tuple[int, int], count: int, harmonic: int) -> Integers:
    """Axial unknowns of the first ``count`` nodes of the face, without the axis for harmonics."""
    number = np.arange(shape[0] * shape[1]).reshape(shape)[:count, 0] * directions(harmonic) + AXIAL
    return number if harmonic == 0 else number[1:]


@lru_cache(maxsize=32)
def _probe_compliance(probe: Probe, mesh: FieldMesh, harmonic: int) -> Floats:
    """Compliance of the face's nodes on the probe, whose glass is fixed."""
    face, edge = _face(probe, mesh), probe.radius_mm
    depth, young, poisson = [np.zeros(1)], [], []
    for layer in probe.layers:
        lines = two_sided_lines(layer.thickness_mm, finest=mesh.finest * edge, growth=mesh.growth, largest=edge / 4)
        depth.append(depth[-1][-1] + lines[1:])
        young += [layer.young_kpa] * (len(lines) - 1)
        poisson += [layer.poisson] * (len(lines) - 1)
    flat = mesh_rectangle(face.lines, np.concatenate(depth), mesh.order, a_is_radius=True)
    radius, below, whole = flat.nodes[..., 0], flat.nodes[..., 1], probe.thickness_mm
    bulged = whole - (whole - below) * (1 - probe.sag_mm(radius) / whole)
    points = element_points(replace(flat, nodes=np.stack([radius, bulged], axis=-1)), harmonic)
    columns, at = len(face.lines) - 1, points.radius_mm.shape
    body = solve_body(
        points,
        np.broadcast_to(np.repeat(young, columns)[:, None], at),
        np.broadcast_to(np.repeat(poisson, columns)[:, None], at),
        free=_free(flat.nodes.shape[:2], harmonic, fixed_side=probe.sides == "bonded"),
        loaded=_loaded(flat.nodes.shape[:2], len(face.radius_mm), harmonic),
    )
    return body.compliance


WAVES = ((3.0, 32), (4.5, 20), (np.inf, 12))  # nodes of the spectrum in each direction for lengths below, mm
DIRECTIONS = 80  # of the responses; with 40 the slopes of a face miss 5 % of their spread


def field_features(harmonic: int, length_mm: float, radius_mm: Floats, depth_mm: Floats) -> tuple[Floats, Floats]:
    """Waves across the axis and along it, shape (waves, points) each.

    The field of unit variance has the correlation ``exp(-x**2 / (2 l**2))`` of points x apart. It is a sum of plane
    waves whose wave numbers are normal with standard deviation 1/l in each direction. Harmonic m around the axis of a
    wave is a Bessel function of the radius, so that covariances of the responses need no covariance between points.

    The products of one of each are features. Their Gram matrix is the covariance of the field's harmonic between points
    (r, z): of its mean around the axis for m = 0, of either part of its harmonic for m >= 1.
    """
    count = next(count for longest, count in WAVES if length_mm < longest)
    square, weight = np.polynomial.laguerre.laggauss(count)
    across = scipy.special.jv(harmonic, np.outer(np.sqrt(2 * square) / length_mm, radius_mm)) * np.sqrt(weight)[:, None]
    node, weight = np.polynomial.hermite_e.hermegauss(count)
    node, weight = node[count // 2 :], 2 * weight[count // 2 :] / weight.sum()  # symmetric in the wave number
    phase, root = np.outer(node / length_mm, depth_mm), np.sqrt(weight)[:, None]
    along = np.concatenate([root * np.cos(phase), root * np.sin(phase)])
    return (1.0 if harmonic == 0 else np.sqrt(2.0)) * across, along


def field_factors(response: Floats, features: Sequence[tuple[Floats, Floats]], *, rank: int) -> Floats:
    """Factors F (lengths, outputs, rank) of the covariances F F' of linear outputs of fields of unit variance.

    Parameters
    ----------
    response
        Outputs by a unit of the field at each point, shape (outputs, points).
    features
        `field_features` of the points for each correlation length.
    rank
        Number of directions; those of less variance are left out.
    """
    # The outputs are few smooth functions of the field: their directions do not depend on its length.
    _, directions = np.linalg.eigh(response @ response.T)
    directions = directions[:, ::-1][:, :DIRECTIONS]
    reduced, factors = directions.T @ response, []
    for across, along in features:
        columns = np.concatenate([(reduced * wave) @ along.T for wave in across], axis=1)
        left, size, _ = np.linalg.svd(columns, full_matrices=False)
        factors.append(directions @ (left[:, :rank] * size[:rank]))
    return np.array(factors)
