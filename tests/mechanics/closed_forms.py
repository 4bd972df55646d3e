"""Presses with a closed-form solution: independent values for the tests of the finite elements.

All bodies are homogeneous, isotropic and under small strain. ``E* = E / (1 - nu**2)`` is the plane-strain modulus.
Lengths are in mm, moduli in kPa, forces in mN.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import legendre

from tsis.mechanics.closed_forms import HertzContact

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


KERNEL_END = 40.0  # 1 - L(u) falls as u**2 exp(-2 u): below 1e-30 there


def oedometric_modulus_kpa(*, young_kpa: float, poisson: float) -> float:
    """Stress over strain between rigid side walls: ``M = E (1 - nu) / ((1 + nu) (1 - 2 nu))``."""
    return young_kpa * (1 - poisson) / ((1 + poisson) * (1 - 2 * poisson))


def hertz(*, radius_mm: float, indentation_mm: float, young_kpa: float, poisson: float) -> HertzContact:
    """Hertz's contact of a rigid sphere: ``a**2 = R d``, ``F = 4/3 E* sqrt(R d**3)``, ``p0 = 2 E* a / (pi R)``."""
    modulus = young_kpa / (1 - poisson**2)
    contact = float(np.sqrt(radius_mm * indentation_mm))
    return HertzContact(
        force_mn=4 / 3 * modulus * contact * indentation_mm,
        contact_radius_mm=contact,
        peak_pressure_kpa=2 * modulus * contact / (np.pi * radius_mm),
    )


def punch_stiffness(*, radius_mm: float, young_kpa: float, poisson: float) -> float:
    """Force over indentation of a rigid flat round punch without friction on a half-space: ``2 E* a``."""
    return 2 * young_kpa / (1 - poisson**2) * radius_mm


def punch_pressure_kpa(radius_mm: ArrayLike, *, punch_radius_mm: float, force_mn: float) -> NDArray[np.float64]:
    """Pressure under a flat punch, ``F / (2 pi a sqrt(a**2 - r**2))``; 0 at its edge and beyond."""
    difference = punch_radius_mm**2 - np.asarray(radius_mm, dtype=float) ** 2
    inside = difference > 0
    root = np.sqrt(np.where(inside, difference, 1.0))
    return np.asarray(np.where(inside, force_mn / (2 * np.pi * punch_radius_mm * root), 0.0))


def bonded_layer_ratio(radius_over_thickness: float, *, poisson: float) -> float:
    """Stiffness of a bonded layer over that of a half-space, under a rigid flat punch without friction.

    The stiffness is ``ratio * 2 E* a``. A function phi on the punch's radius gives the pressure's transform (Lebedev
    and Ufliand 1958). It solves a Fredholm equation of the second kind: with s = a / H and x in [0, 1]

        phi(x) - 2 s / pi int_0^1 phi(y) int_0^inf (1 - L(u)) cos(u s x) cos(u s y) du dy = 1,
        L(u) = (2 kappa sinh 2u - 4u) / (2 kappa cosh 2u + 4 u**2 + 1 + kappa**2),   kappa = 3 - 4 nu,

    and the ratio is the integral of phi.
    """
    fraction, kappa = radius_over_thickness, 3 - 4 * poisson
    # The points resolve the fastest cosine, cos(u s) up to u = KERNEL_END, and phi's steep end under a wide punch.
    u, du = _gauss(KERNEL_END, 80 + int(8 * fraction))
    x, dx = _gauss(1.0, 24 + int(8 * fraction))
    waves = np.cos(fraction * np.outer(x, u))
    # 1 - L(u) without cancellation: the compliance that a bonded layer lacks against a half-space.
    lacking = 2 * kappa * np.exp(-2 * u) + 4 * u**2 + 1 + kappa**2 + 4 * u
    lacking /= 2 * kappa * np.cosh(2 * u) + 4 * u**2 + 1 + kappa**2
    kernel = 2 * fraction / np.pi * (waves * (du * lacking)) @ waves.T
    phi = np.linalg.solve(np.eye(len(x)) - kernel * dx, np.ones(len(x)))
    return float(dx @ phi)


def sphere_in_uniaxial_stress(
    *, contrast: float, poisson: float, sphere_poisson: float | None = None
) -> tuple[float, float]:
    """Axial stress and axial strain in a bonded sphere over those far from it, by Eshelby's tensor (1957).

    ``e_v = e_v0 / (1 + alpha (K_i / K - 1))`` and ``e' = e'0 / (1 + beta (G_i / G - 1))`` with
    ``alpha = (1 + nu) / (3 (1 - nu))`` and ``beta = 2 (4 - 5 nu) / (15 (1 - nu))``. ``contrast`` is Young's modulus of
    the sphere over that of the body.
    """
    inner = poisson if sphere_poisson is None else sphere_poisson
    bulk, shear = 1 / (3 * (1 - 2 * poisson)), 1 / (2 * (1 + poisson))  # for a body of modulus 1 under a stress of 1
    bulk_in, shear_in = contrast / (3 * (1 - 2 * inner)), contrast / (2 * (1 + inner))
    alpha, beta = (1 + poisson) / (3 * (1 - poisson)), 2 * (4 - 5 * poisson) / (15 * (1 - poisson))
    volume = 1 / (3 * bulk) / (1 + alpha * (bulk_in / bulk - 1))
    shape = 1 / (3 * shear) / (1 + beta * (shear_in / shear - 1))
    return bulk_in * volume + 2 * shear_in * shape, volume / 3 + shape


def _gauss(high: float, count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Gauss-Legendre points and weights on [0, high]."""
    x, w = legendre.leggauss(count)
    return np.asarray(high / 2 * (x + 1)), np.asarray(high / 2 * w)
