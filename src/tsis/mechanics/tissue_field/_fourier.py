"""Bodies of revolution under loads that vary as a harmonic around the axis: Fourier elements of any order.

The displacements of harmonic m are ``u_r = U cos m a``, ``u_z = W cos m a`` and ``u_a = V sin m a`` at the angle a. For
m = 0 there is no u_a. Strains have the order rr, zz, aa, rz, ra, za; shear strains are engineering strains.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.mechanics._element import Floats, Integers, lame_constants, reference_element

if TYPE_CHECKING:
    from tsis.mechanics._element import Booleans
    from tsis.mechanics._mesh import LayeredMesh

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
