"""Axisymmetric elastic quadrilaterals of any order, all stiffness matrices of a mesh in one batch.

Nodes are Gauss-Lobatto-Legendre points, so that high orders stay well conditioned; integration is Gauss-Legendre.
Displacements are ordered (u_r, u_z) node by node. Forces are those of the whole ring: the factor 2 pi r is inside.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import legendre

if TYPE_CHECKING:
    from numpy.typing import NDArray


@cache
def lobatto_points(order: int) -> NDArray[np.float64]:
    """The ``order + 1`` Gauss-Lobatto-Legendre points on [-1, 1]."""
    inner = legendre.Legendre.basis(order).deriv().roots()
    points = np.concatenate([[-1.0], np.sort(np.real(inner)), [1.0]])
    points.flags.writeable = False
    return points


def lagrange(nodes: NDArray[np.float64], x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lagrange polynomials on ``nodes`` and their derivatives at ``x``; both of shape (len(x), len(nodes))."""
    vandermonde = legendre.legvander(nodes, len(nodes) - 1)
    modes = np.linalg.inv(vandermonde)
    values = legendre.legvander(x, len(nodes) - 1) @ modes
    slopes = np.stack([legendre.legval(x, legendre.legder(mode)) for mode in modes.T], axis=1)
    return np.asarray(values, dtype=float), np.asarray(slopes, dtype=float)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reference:
    """Shape functions of the reference square at its integration points: arrays of shape (points, nodes)."""

    value: NDArray[np.float64]
    slope_a: NDArray[np.float64]
    slope_b: NDArray[np.float64]
    weight: NDArray[np.float64]


@cache
def reference(order: int) -> Reference:
    """The reference square of ``order``; node (i, j) has the index ``i * (order + 1) + j``."""
    x, w = (np.asarray(part, dtype=float) for part in legendre.leggauss(order + 1))
    value, slope = lagrange(lobatto_points(order), x)
    return Reference(
        value=np.asarray(np.kron(value, value), dtype=float),
        slope_a=np.asarray(np.kron(slope, value), dtype=float),
        slope_b=np.asarray(np.kron(value, slope), dtype=float),
        weight=np.kron(w, w),
    )


def stiffness(
    nodes: NDArray[np.float64], order: int, young_kpa: NDArray[np.float64], poisson: NDArray[np.float64]
) -> NDArray[np.float64]:
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
    ref = reference(order)
    jacobian = np.stack([ref.slope_a @ nodes, ref.slope_b @ nodes], axis=-2)  # (e, q, direction, r or z)
    determinant = np.linalg.det(jacobian)
    slopes = np.linalg.inv(jacobian) @ np.stack([ref.slope_a, ref.slope_b], axis=1)
    radius = nodes[..., 0] @ ref.value.T
    elements, points, count = len(nodes), len(ref.weight), (order + 1) ** 2
    strain = np.zeros((elements, points, 4, count, 2))  # rr, zz, hoop, rz
    strain[:, :, 0, :, 0] = slopes[:, :, 0]
    strain[:, :, 1, :, 1] = slopes[:, :, 1]
    strain[:, :, 2, :, 0] = ref.value / radius[..., None]
    strain[:, :, 3, :, 0] = slopes[:, :, 1]
    strain[:, :, 3, :, 1] = slopes[:, :, 0]
    matrix = strain.reshape(elements, points, 4, 2 * count)
    volume = 2 * np.pi * radius * np.abs(determinant) * ref.weight
    stress = elasticity(young_kpa, poisson)[:, None] @ matrix
    stress *= volume[..., None, None]
    flat = (elements, points * 4, 2 * count)
    return np.asarray(np.swapaxes(matrix.reshape(flat), 1, 2) @ stress.reshape(flat))


def elasticity(young_kpa: NDArray[np.float64], poisson: NDArray[np.float64]) -> NDArray[np.float64]:
    """Hooke's law (rr, zz, hoop, rz) of each element, shape (elements, 4, 4), engineering shear strain."""
    shear = young_kpa / (2 * (1 + poisson))
    lame = 2 * shear * poisson / (1 - 2 * poisson)
    matrix = np.zeros((len(young_kpa), 4, 4))
    matrix[:, :3, :3] = lame[:, None, None]
    for i in range(3):
        matrix[:, i, i] += 2 * shear
    matrix[:, 3, 3] = shear
    return matrix
