"""Compressible neo-Hookean rubber in axisymmetry: energy, first Piola stress and tangent of the deformation gradient.

``W = mu/2 (I1 - 3 - 2 ln J) + lambda/2 ln^2 J`` per reference volume. An axisymmetric deformation gradient has five
components: rR, rZ, zR, zZ and the hoop, along the FIRST axis of an array; all functions are batched over the other
axes. Stresses have the unit of the moduli (kPa).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from tsis.mechanics._element import Floats


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


def tangent(gradient: Floats, mu: Floats, lam: Floats, pull: Floats | None = None) -> Floats:
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
