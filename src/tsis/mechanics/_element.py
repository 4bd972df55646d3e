"""Axisymmetric elastic quadrilaterals of any order, all stiffness matrices of a mesh in one batch.

Nodes are Gauss-Lobatto-Legendre points, so that high orders stay well conditioned; integration is Gauss-Legendre.
Displacements are ordered (u_r, u_z) node by node. Forces act on the whole ring: they include the factor 2 pi r.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

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
