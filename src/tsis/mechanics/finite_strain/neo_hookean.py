"""Compressible neo-Hookean rubber in axisymmetry: stress and tangent at a point, energy and forces of a meshed body.

``W = mu/2 (I1 - 3 - 2 ln J) + lambda/2 ln^2 J`` per reference volume. An axisymmetric deformation gradient has five
components: rR, rZ, zR, zZ and the hoop, along the FIRST axis of an array; all functions are batched over the other
axes. Stresses have the unit of the moduli (kPa).

A body is total Lagrangian: the operators from displacements to the deformation gradient are computed once. The unknown
displacements of the skeleton (nodes on the sides of elements) come first, then those inside the elements, which are
eliminated element by element.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.mechanics.mesh import Floats, Integers, lame_constants, reference_element

if TYPE_CHECKING:
    from tsis.mechanics.finite_strain.patches import Solid
    from tsis.mechanics.mesh import Floats


RR, RZ, ZR, ZZ, HOOP = range(5)
IN_PLANE = (RR, RZ, ZR, ZZ)
ROW = (0, 0, 1, 1)  # of the in-plane components
COLUMN = (0, 1, 0, 1)


def volume_ratio(gradient: Floats) -> Floats:
    """J, the current volume over the reference volume."""
    plane = gradient[RR] * gradient[ZZ] - gradient[RZ] * gradient[ZR]
    return np.asarray(plane * gradient[HOOP])


def energy(gradient: Floats, mu: Floats, lam: Floats) -> Floats:
    """Strain energy per reference volume in kPa (mN/mm^2 = mN mm/mm^3); infinite where det F <= 0."""
    ratio = volume_ratio(gradient)
    upright = (ratio > 0) & (gradient[HOOP] > 0)
    log = np.log(np.where(upright, ratio, 1.0))
    stretch = np.einsum("k...,k...->...", gradient, gradient) - 3
    return np.where(upright, mu / 2 * (stretch - 2 * log) + lam / 2 * log**2, np.inf)


def stress(gradient: Floats, mu: Floats, lam: Floats) -> Floats:
    """First Piola stress in kPa, the derivative of `energy` by the deformation gradient: same shape as ``gradient``."""
    pull = volumetric_stress(gradient, lam) - mu
    return mu * gradient + pull * _inverse_transposed(gradient)


def elasticity(gradient: Floats, mu: Floats, lam: Floats, pull: Floats | None = None) -> Floats:
    """Derivative of `stress` by the deformation gradient in kPa, shape (5, 5, ...), symmetric in its first two axes.

    ``pull`` replaces `volumetric_stress` in the geometric part of the tangent.
    """
    inverse = _inverse_transposed(gradient)
    geometric = mu - (volumetric_stress(gradient, lam) if pull is None else pull)
    result = lam * inverse[:, None] * inverse[None]
    for i in IN_PLANE:
        for k in IN_PLANE:
            # d(F^-T)_iJ / dF_kL = -(F^-T)_iL (F^-T)_kJ
            crossed = inverse[2 * ROW[i] + COLUMN[k]] * inverse[2 * ROW[k] + COLUMN[i]]
            result[i, k] += geometric * crossed
    result[HOOP, HOOP] += geometric * inverse[HOOP] ** 2
    for i in range(5):
        result[i, i] += mu
    return np.asarray(result)


def volumetric_stress(gradient: Floats, lam: Floats) -> Floats:
    """``lambda ln J`` in kPa."""
    return np.asarray(lam * np.log(volume_ratio(gradient)))


def volumetric_stress_change(gradient: Floats, change: Floats, lam: Floats) -> Floats:
    """First-order change of `volumetric_stress` with a ``change`` of the deformation gradient, kPa."""
    return np.asarray(lam * np.einsum("k...,k...->...", _inverse_transposed(gradient), change))


def principal_stretches(gradient: Floats) -> Floats:
    """The three principal stretches, shape (3, ...): larger and smaller in the plane, then the hoop."""
    total = np.einsum("k...,k...->...", gradient[:4], gradient[:4])
    plane = gradient[RR] * gradient[ZZ] - gradient[RZ] * gradient[ZR]
    difference = np.sqrt(np.maximum(total**2 - 4 * plane**2, 0.0))
    larger = np.sqrt((total + difference) / 2)
    return np.stack([larger, np.abs(plane) / larger, np.abs(gradient[HOOP])])


def _inverse_transposed(gradient: Floats) -> Floats:
    plane = gradient[RR] * gradient[ZZ] - gradient[RZ] * gradient[ZR]
    return np.stack(
        [
            gradient[ZZ] / plane,
            -gradient[ZR] / plane,
            -gradient[RZ] / plane,
            gradient[RR] / plane,
            1 / gradient[HOOP],
        ]
    )


FIXED, OWN = -1, -2  # node directions without a shared unknown: fixed, or with an unknown of their own
RADIAL, AXIAL = (RR, RZ, HOOP), (ZR, ZZ)  # components that u_r and u_z act on


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Numbering:
    """Map from node directions to unknowns."""

    # Index of the unknown for (u_r, u_z) of every node, shape (nodes, 2); `FIXED` where the node cannot move
    of_node: Integers
    skeleton: int  # number of unknowns outside element interiors; they come first
    total: int  # number of unknowns

    def displacements(self, unknowns: Floats) -> Floats:
        """Displacements (u_r, u_z) of all nodes in mm."""
        return np.append(unknowns, 0.0)[self.of_node]


def number_unknowns(solid: Solid, shared: Integers, shared_count: int) -> Numbering:
    """Number the unknowns of a mesh; the ``shared_count`` shared ones come first.

    ``shared`` has shape (nodes, 2): `FIXED`, the index of a shared unknown (from 0), or `OWN`.
    """
    interior = solid.cells[:, _inner(solid.order)]
    inside = np.zeros(len(solid.nodes), dtype=bool)
    inside[interior] = True
    of_node = shared.copy()
    skeleton = (shared == OWN) & ~inside[:, None]
    edge_count = int(skeleton.sum())
    of_node[skeleton] = shared_count + np.arange(edge_count)
    first = shared_count + edge_count
    of_node[interior] = first + np.arange(interior.size * 2).reshape(*interior.shape, 2)
    return Numbering(of_node=of_node, skeleton=first, total=first + interior.size * 2)


def _inner(order: int) -> Integers:
    grid = np.arange((order + 1) ** 2).reshape(order + 1, order + 1)
    return np.asarray(grid[1:-1, 1:-1].ravel())


def _outer(order: int) -> Integers:
    return np.setdiff1d(np.arange((order + 1) ** 2), _inner(order))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tangent:
    """A quadratic model of the energy, reduced to the skeleton."""

    matrices: Floats  # condensed tangent of each element, shape (elements, m, m), mN/mm
    forces: Floats  # condensed gradient of each element, shape (elements, m), mN
    # Interior displacements are ``rest - back @ (skeleton's)``
    back: Floats
    rest: Floats
    gradient: Floats  # deformation gradient at the integration points
    relief: float  # interior forces times ``rest``, mN mm: the interiors' part of the slope of the energy


class ElasticBody:
    """Meshed neo-Hookean bodies with numbered unknowns."""

    def __init__(self, solid: Solid, numbering: Numbering) -> None:
        self.solid, self.numbering = solid, numbering
        self._operator, self.volume = _operators(solid)
        self._flat = self._operator.reshape(len(solid.cells), -1, self._operator.shape[-1])
        mu, lam = lame_constants(solid.young_kpa, solid.poisson)
        self._mu, self._lam = mu[:, None], lam[:, None]
        self._inner, self._outer = _inner(solid.order), _outer(solid.order)
        self.element_unknowns = numbering.of_node[solid.cells[:, self._outer]].reshape(len(solid.cells), -1)

    def gradient(self, displacements: Floats) -> Floats:
        """Deformation gradient at the integration points, shape (5, elements, points)."""
        result = self._spread(displacements)
        for i in (RR, ZZ, HOOP):
            result[i] += 1
        return result

    def _spread(self, displacements: Floats) -> Floats:
        """Derivatives of displacements at the integration points, shape (5, elements, points)."""
        derivative = (self._flat @ displacements[self.solid.cells]).reshape(*self._operator.shape[:3], 2)
        result = np.empty((5, *self.volume.shape))
        result[RR], result[RZ], result[HOOP] = derivative[:, :, 0, 0], derivative[:, :, 1, 0], derivative[:, :, 2, 0]
        result[ZR], result[ZZ] = derivative[:, :, 0, 1], derivative[:, :, 1, 1]
        return result

    def energy(self, displacements: Floats) -> float:
        """Strain energy in mN mm; infinite where an element has det F <= 0."""
        density = energy(self.gradient(displacements), self._mu, self._lam)
        return float(np.sum(density * self.volume))

    def forces(self, displacements: Floats) -> Floats:
        """Gradient of the energy by all nodal displacements in mN, shape (elements, nodes an element, 2)."""
        gradient = self.gradient(displacements)
        return self._element_forces(stress(gradient, self._mu, self._lam) * self.volume)

    def _element_forces(self, stress: Floats) -> Floats:
        elements = len(self._flat)
        radial = np.stack([stress[i] for i in RADIAL], axis=-1).reshape(elements, 1, -1)
        axial = np.stack([*(stress[i] for i in AXIAL), np.zeros_like(stress[0])], axis=-1)
        both = np.concatenate([radial, axial.reshape(elements, 1, -1)], axis=1)
        return np.swapaxes(both @ self._flat, 1, 2)

    def matrices(self, displacements: Floats) -> Floats:
        """Tangents of all elements in mN/mm, shape (elements, n, n) with unknowns (u_r, u_z) node by node."""
        return self._element_matrices(self.gradient(displacements), None)

    def volumetric_stress(self, displacements: Floats) -> Floats:
        """Volumetric stress at the integration points in kPa, shape (elements, points)."""
        return self.volumetric_stress_at(self.gradient(displacements))

    def volumetric_stress_at(self, gradient: Floats) -> Floats:
        """Volumetric stress from the deformation gradient."""
        return volumetric_stress(gradient, self._lam)

    def volumetric_change(self, gradient: Floats, displacements: Floats) -> Floats:
        """First-order change of the volumetric stress with more ``displacements``, kPa, shape (elements, points)."""
        return volumetric_stress_change(gradient, self._spread(displacements), self._lam)

    def _element_matrices(self, gradient: Floats, pull: Floats | None) -> Floats:
        tangent = elasticity(gradient, self._mu, self._lam, pull) * self.volume
        operator, flat = self._operator, self._flat.swapaxes(1, 2)
        elements, points, _, count = operator.shape
        result = np.empty((elements, count, 2, count, 2))
        blocks = {(0, 0): (RADIAL, RADIAL), (0, 1): (RADIAL, AXIAL), (1, 1): (AXIAL, AXIAL)}
        for (row, column), (left, right) in blocks.items():
            transported = np.zeros((elements, points, 3, count))
            for i, item in enumerate(left):
                for j, other in enumerate(right):
                    transported[:, :, i] += tangent[item, other][..., None] * operator[:, :, j]
            result[:, :, row, :, column] = flat @ transported.reshape(elements, points * 3, count)
        result[:, :, 1, :, 0] = np.swapaxes(result[:, :, 0, :, 1], 1, 2)
        return result.reshape(elements, 2 * count, 2 * count)

    def tangent(self, displacements: Floats, pull: Floats | None = None) -> Tangent:
        """Gradient and tangent, reduced to the skeleton.

        ``pull`` is a volumetric stress (elements, points) in kPa that is an unknown of its own in Newton's method. The
        true stress amplifies any error in the volume; after a large step it would spoil the tangent.
        """
        gradient = self.gradient(displacements)
        force = self._element_forces(stress(gradient, self._mu, self._lam) * self.volume)
        matrix = self._element_matrices(gradient, pull)
        inner = (2 * self._inner[:, None] + [0, 1]).ravel()
        outer = (2 * self._outer[:, None] + [0, 1]).ravel()
        force = force.reshape(len(force), -1)
        coupling = matrix[:, inner[:, None], outer]
        right = np.concatenate([coupling, -force[:, inner, None]], axis=2)
        solved = np.linalg.solve(matrix[:, inner[:, None], inner], right)
        back, rest = solved[:, :, :-1], solved[:, :, -1]
        transposed = np.swapaxes(coupling, 1, 2)
        return Tangent(
            matrices=matrix[:, outer[:, None], outer] - transposed @ back,
            forces=force[:, outer] + (transposed @ rest[..., None])[..., 0],
            back=back,
            rest=rest,
            gradient=gradient,
            relief=float((force[:, inner] * rest).sum()),
        )


def _operators(solid: Solid) -> tuple[Floats, Floats]:
    """Operator (elements, points, 3, nodes) to d/dR, d/dZ and 1/R, and the volume of every integration point."""
    ref = reference_element(solid.order)
    nodes = solid.nodes[solid.cells]
    jacobian = np.stack([ref.slope_a @ nodes, ref.slope_b @ nodes], axis=-2)
    determinant = np.linalg.det(jacobian)
    slopes = np.linalg.inv(jacobian) @ np.stack([ref.slope_a, ref.slope_b], axis=1)
    radius = nodes[..., 0] @ ref.value.T
    operator = np.concatenate([slopes, (ref.value / radius[..., None])[:, :, None]], axis=2)
    return np.ascontiguousarray(operator), 2 * np.pi * radius * np.abs(determinant) * ref.weight
