"""What uneven tissue does to a press: its linear response, by harmonics.

Bodies of revolution under loads that vary as a harmonic around the axis are Fourier elements of any order. The
displacements of harmonic m are ``u_r = U cos m a``, ``u_z = W cos m a`` and ``u_a = V sin m a`` at the angle a. For
m = 0 there is no u_a. Strains have the order rr, zz, aa, rz, ra, za; shear strains are engineering strains.

The field phi is the small change of the logarithm of the modulus at each point. The press covers the face. Strains of
unit forces on the face are the adjoint: a change of the stiffness at a point changes the face's displacement by
``-phi strain : stress`` of the press without it, and the contact answers with the compliance of both bodies, at fixed
force. A round press and harmonic m of the field give harmonic m of the response.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.mechanics.mesh import (
    Face,
    Floats,
    Integers,
    face_lines,
    graded,
    lame_constants,
    mesh_rectangle,
    outer_lines,
    reference_element,
    two_sided_lines,
)
from tsis.model.press import MN_PER_N

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.mechanics.mesh import Booleans, Floats, Integers, LayeredMesh
    from tsis.model.probe import Probe


RADIAL, AXIAL, AROUND = range(3)  # directions of the displacement
NORMAL_STRAINS, ROUND_STRAINS = 3, 4  # strains with a trace; strains that a load around the axis causes


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HarmonicBody:
    """One body under loads of one harmonic, factorised.

    Attributes
    ----------
    compliance
        Normal displacement of the loaded nodes by normal forces on them, mm/mN, shape (n, n).
    radius_mm, depth_mm
        Coordinates of the integration points, shape (points,).
    strain
        First four strains at the points by a unit force on each loaded node, times the point's weight in mm**3, shape
        (points, 4, n).
    stress
        First four stresses in kPa at the points by a unit force on each loaded node, shape (points, 4, n).
    """

    compliance: Floats
    radius_mm: Floats
    depth_mm: Floats
    strain: Floats
    stress: Floats


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ElementPoints:
    """Integration points of all elements: strain operators (elements, points, 6, n), weights and coordinates."""

    strain: Floats
    weight: Floats
    radius_mm: Floats
    depth_mm: Floats
    unknowns: Integers  # of each element, shape (elements, n)


def directions(harmonic: int) -> int:
    """Number of displacements of a node."""
    return 2 if harmonic == 0 else 3


def element_points(mesh: LayeredMesh, harmonic: int) -> ElementPoints:
    """Strain operators at the integration points of a mesh, elements in the order of its layers."""
    count = mesh.nodes.shape[0] * mesh.nodes.shape[1]
    number = np.arange(count).reshape(mesh.nodes.shape[:2])
    cells = np.concatenate([mesh.layer(index, number) for index in range(mesh.layers)])
    nodes, ref = mesh.nodes.reshape(-1, 2)[cells], reference_element(mesh.order)
    r_a, z_a = np.moveaxis(ref.slope_a @ nodes, -1, 0)
    r_b, z_b = np.moveaxis(ref.slope_b @ nodes, -1, 0)
    determinant = r_a * z_b - r_b * z_a
    radius, depth = nodes[..., 0] @ ref.value.T, nodes[..., 1] @ ref.value.T
    by_r = (z_b / determinant)[..., None] * ref.slope_a - (z_a / determinant)[..., None] * ref.slope_b
    by_z = (r_a / determinant)[..., None] * ref.slope_b - (r_b / determinant)[..., None] * ref.slope_a
    over_r = ref.value / radius[..., None]
    per_node = directions(harmonic)
    strain = np.zeros((*radius.shape, 6, cells.shape[1], per_node))
    strain[:, :, 0, :, RADIAL], strain[:, :, 1, :, AXIAL], strain[:, :, 2, :, RADIAL] = by_r, by_z, over_r
    strain[:, :, 3, :, RADIAL], strain[:, :, 3, :, AXIAL] = by_z, by_r
    if harmonic:
        strain[:, :, 2, :, AROUND] = harmonic * over_r
        strain[:, :, 4, :, RADIAL], strain[:, :, 4, :, AROUND] = -harmonic * over_r, by_r - over_r
        strain[:, :, 5, :, AXIAL], strain[:, :, 5, :, AROUND] = -harmonic * over_r, by_z
    around = 2 * np.pi if harmonic == 0 else np.pi  # integral of cos**2 around the axis
    unknowns = cells[:, :, None] * per_node + np.arange(per_node)
    return ElementPoints(
        strain=strain.reshape(*radius.shape, 6, -1),
        weight=around * radius * np.abs(determinant) * ref.weight,
        radius_mm=radius,
        depth_mm=depth,
        unknowns=unknowns.reshape(len(cells), -1),
    )


def stresses(strain: Floats, young_kpa: Floats, poisson: Floats) -> Floats:
    """Stresses of strain operators (elements, points, 6, n) in material (elements, points)."""
    shear, lame = (constant[..., None, None] for constant in lame_constants(young_kpa, poisson))
    stress = shear * strain
    normal = strain[:, :, :NORMAL_STRAINS]
    stress[:, :, :NORMAL_STRAINS] = 2 * shear * normal + lame * normal.sum(axis=2, keepdims=True)
    return np.asarray(stress)


def solve_body(
    points: ElementPoints, young_kpa: Floats, poisson: Floats, *, free: Booleans, loaded: Integers
) -> HarmonicBody:
    """Factorise a body and load its nodes.

    Parameters
    ----------
    points
        The body's elements.
    young_kpa, poisson
        Material at the integration points, shape (elements, points).
    free
        Mask of the unknowns that are not fixed, shape (unknowns,).
    loaded
        Unknowns with a unit force each.
    """
    stress = stresses(points.strain, young_kpa, poisson)
    weighted = points.strain * points.weight[..., None, None]
    matrices = np.einsum("egsi,egsj->eij", weighted, stress, optimize=True)
    rows = np.broadcast_to(points.unknowns[:, :, None], matrices.shape).ravel()
    columns = np.broadcast_to(points.unknowns[:, None, :], matrices.shape).ravel()
    stiffness = scipy.sparse.coo_array((matrices.ravel(), (rows, columns)), shape=(len(free), len(free))).tocsc()
    inside = np.flatnonzero(free)
    forces = np.zeros((len(free), len(loaded)))
    forces[loaded, np.arange(len(loaded))] = 1.0
    options = {"SymmetricMode": True}
    factor = scipy.sparse.linalg.splu(
        stiffness[inside][:, inside], permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options
    )
    moved = np.zeros_like(forces)
    moved[inside] = factor.solve(forces[inside])
    of_elements = moved[points.unknowns]
    shape = (-1, ROUND_STRAINS, len(loaded))
    strain, answer = (
        np.einsum("egsi,ein->egsn", part[:, :, :ROUND_STRAINS], of_elements, optimize=True).reshape(shape)
        for part in (weighted, stress)
    )
    return HarmonicBody(
        compliance=moved[loaded],
        radius_mm=points.radius_mm.ravel(),
        depth_mm=points.depth_mm.ravel(),
        strain=strain,
        stress=answer,
    )


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
    volume_mm3
        Integral of the harmonic's square around the axis over each point's cell, shape (points,): the response over
        it is that to a unit of volume at one place.
    """

    pressure_kpa: Floats
    face_displacement_mm: Floats
    radius_mm: Floats
    depth_mm: Floats
    volume_mm3: Floats


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ContactAnswer:
    """What the contact of probe and tissue answers to one harmonic of a displacement of the tissue's face.

    Attributes
    ----------
    radius_mm
        Radii of the nodes of the face, shape (nodes,); without the axis for harmonics above 0.
    force_mn
        Change of the nodal forces by a unit displacement of each node out of the probe's way, shape (nodes, nodes).
    pressure_kpa, face_displacement_mm
        Profiles over the response's radii by a unit of each nodal force, shape (radii, nodes).
    """

    radius_mm: Floats
    force_mn: Floats
    pressure_kpa: Floats
    face_displacement_mm: Floats


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
        tissue, _ = self._bodies(harmonic)
        round_stress = self._bodies(0)[0].stress @ self._round_forces
        # The displacement of the face by the field, without the minus sign: stiffer tissue is pressed in less.
        moved = np.einsum("gsn,gsp->png", tissue.strain, round_stress, optimize=True)
        answer = self.contact_answer(harmonic)
        return FieldResponse(
            pressure_kpa=answer.pressure_kpa @ answer.force_mn @ moved,
            face_displacement_mm=answer.face_displacement_mm @ answer.force_mn @ moved,
            radius_mm=tissue.radius_mm,
            depth_mm=tissue.depth_mm,
            volume_mm3=_points(self._slab, harmonic).weight.ravel(),
        )

    def contact_answer(self, harmonic: int) -> ContactAnswer:
        """Answer of the contact to a displacement of the face, harmonic by harmonic; at fixed force for harmonic 0."""
        tissue, probe_compliance = self._bodies(harmonic)
        inverse = np.linalg.inv(tissue.compliance + probe_compliance)
        if harmonic == 0:  # at fixed force
            row_sums = inverse.sum(axis=1)
            inverse = inverse - np.outer(row_sums, row_sums) / row_sums.sum()
        pressure, displacement = self._outputs(harmonic, probe_compliance)
        return ContactAnswer(
            radius_mm=self.face.radius_mm if harmonic == 0 else self.face.radius_mm[1:],
            force_mn=np.asarray(inverse, dtype=float),
            pressure_kpa=pressure,
            face_displacement_mm=displacement,
        )

    def stiffness_change(self) -> Floats:
        """Relative change of the force at one travel of the glass by a unit of the field at each point, (points,).

        The travel under a unit force falls by the energy of its strains there, which reciprocity turns into this. With
        a rigid probe it sums to 1: tissue twice as stiff needs twice the force.
        """
        tissue, force = self._bodies(0)[0], self._round_forces[:, 0]
        travel = self.travel_per_newton()
        energy = np.einsum("gsn,gs,n->g", tissue.strain, tissue.stress @ force, force, optimize=True)
        return np.asarray(energy / (MN_PER_N * travel))

    def travel_per_newton(self) -> float:
        """Travel of the glass in mm by one newton."""
        tissue, probe_compliance = self._bodies(0)
        return float(((tissue.compliance + probe_compliance) @ self._round_forces[:, 0])[0])

    def round_forces_mn(self) -> Floats:
        """Nodal forces in mN of the unit press per newton and of the press by the dome's shape, shape (nodes, 2)."""
        return np.array(self._round_forces)

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
