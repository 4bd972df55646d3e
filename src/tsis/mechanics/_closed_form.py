"""Presses with a closed-form solution: reference values for the finite elements, and first estimates.

All bodies are homogeneous, isotropic and under small strain. ``E* = E / (1 - nu**2)`` is the plane-strain modulus.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import legendre

from tsis.errors import InputError
from tsis.model import Layer, require_number

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray


LARGEST_POISSON = 0.4999
KERNEL_END = 40.0  # 1 - L(u) falls as u**2 exp(-2 u): below 1e-30 there


def effective_modulus_kpa(layers: Sequence[Layer]) -> float:
    """Modulus in kPa of the uniform bar that is as stiff as the stack: springs in series, free to spread sideways.

    ``E = sum(L) / sum(L / E)``, the dissertation's (3.78). It holds for Poisson's ratio 0 or for layers that slide on
    each other and on the glass. A bonded stack is stiffer, up to `confined_modulus_kpa`.

    Parameters
    ----------
    layers
        The stack in any order, at least one layer.

    Raises
    ------
    InputError
        When there is no layer.

    Examples
    --------
    >>> stack = [Layer(thickness_mm=t, young_kpa=e) for t, e in ((2, 140), (3, 80), (5, 34))]
    >>> round(effective_modulus_kpa(stack), 4)
    50.2905
    """
    return _in_series(layers, [layer.young_kpa for layer in _stack(layers)])


def confined_modulus_kpa(layers: Sequence[Layer]) -> float:
    """Modulus in kPa of a stack that cannot spread sideways: the upper bound for a bonded stack.

    ``M = sum(L) / sum(L / M_i)`` with the `oedometric_modulus_kpa` of each layer. A real probe, bonded to glass with
    free sides, lies between this and `effective_modulus_kpa`.

    Raises
    ------
    InputError
        When there is no layer.

    Examples
    --------
    >>> stack = [Layer(thickness_mm=t, young_kpa=e, poisson=0.49) for t, e in ((2, 140), (3, 80), (5, 34))]
    >>> round(confined_modulus_kpa(stack), 1)
    860.7
    """
    moduli = [oedometric_modulus_kpa(young_kpa=layer.young_kpa, poisson=layer.poisson) for layer in _stack(layers)]
    return _in_series(layers, moduli)


def oedometric_modulus_kpa(*, young_kpa: float, poisson: float) -> float:
    """Stress over strain in kPa of a body compressed between rigid side walls.

    ``M = E (1 - nu) / ((1 + nu) (1 - 2 nu))``.

    Parameters
    ----------
    young_kpa
        Young's modulus, kPa, in [1e-6, 1e12].
    poisson
        Poisson's ratio, in [0, 0.4999].

    Examples
    --------
    >>> oedometric_modulus_kpa(young_kpa=5.0, poisson=0.0)
    5.0
    """
    young, ratio = _material(young_kpa, poisson)
    return young * (1 - ratio) / ((1 + ratio) * (1 - 2 * ratio))


@dataclass(frozen=True, slots=True, kw_only=True)
class HertzContact:
    """A rigid sphere pressed without friction on a half-space.

    Attributes
    ----------
    force_mn
        Force, mN.
    contact_radius_mm
        Radius a of the contact, mm.
    peak_pressure_kpa
        Pressure in the centre, kPa.
    """

    force_mn: float
    contact_radius_mm: float
    peak_pressure_kpa: float

    def pressure_kpa(self, radius_mm: ArrayLike) -> NDArray[np.float64]:
        """Pressure ``p0 sqrt(1 - r**2 / a**2)`` at ``radius_mm`` (any shape), zero outside the contact."""
        fraction = np.asarray(radius_mm, dtype=float) / self.contact_radius_mm
        return np.asarray(self.peak_pressure_kpa * np.sqrt(np.maximum(1 - fraction**2, 0.0)))


def hertz(*, radius_mm: float, indentation_mm: float, young_kpa: float, poisson: float) -> HertzContact:
    """Hertz's contact of a rigid sphere: ``a**2 = R d``, ``F = 4/3 E* sqrt(R d**3)``, ``p0 = 2 E* a / (pi R)``.

    The sphere is replaced by its paraboloid, so the indentation must be small against the radius.

    Parameters
    ----------
    radius_mm
        Radius R of the sphere, mm, in [1e-6, 1e6].
    indentation_mm
        Depth d of the sphere's lowest point below the undeformed surface, mm, in (0, R].
    young_kpa, poisson
        The half-space: kPa in [1e-6, 1e12], and in [0, 0.4999].

    Raises
    ------
    InputError
        When a value lies outside its range.

    Examples
    --------
    >>> contact = hertz(radius_mm=10.0, indentation_mm=0.5, young_kpa=5.0, poisson=0.3)
    >>> round(contact.force_mn, 4), round(contact.peak_pressure_kpa, 4)
    (8.1907, 0.7822)
    """
    radius = require_number("radius_mm", radius_mm, 1e-6, 1e6, hint="millimetres")
    depth = require_number("indentation_mm", indentation_mm, 1e-12, radius, hint="millimetres, at most the radius")
    modulus = _plane_strain(young_kpa, poisson)
    contact = float(np.sqrt(radius * depth))
    return HertzContact(
        force_mn=4 / 3 * modulus * contact * depth,
        contact_radius_mm=contact,
        peak_pressure_kpa=2 * modulus * contact / (np.pi * radius),
    )


def hertz_under_force(*, radius_mm: float, force_mn: float, young_kpa: float, poisson: float) -> HertzContact:
    """Hertz's contact of a rigid sphere under a force: ``a**3 = 3 F R / (4 E*)``, ``p0 = 3 F / (2 pi a**2)``.

    A force may push a small sphere in deeper than its radius. The pressure is then the pressure of the paraboloid,
    which is wider than the sphere.

    Parameters
    ----------
    radius_mm
        Radius R of the sphere, mm, in [1e-6, 1e6].
    force_mn
        Force F, mN, in [1e-12, 1e12].
    young_kpa, poisson
        The half-space: kPa in [1e-6, 1e12], and in [0, 0.4999].

    Raises
    ------
    InputError
        When a value lies outside its range.

    Examples
    --------
    >>> contact = hertz_under_force(radius_mm=10.0, force_mn=8.1907, young_kpa=5.0, poisson=0.3)
    >>> round(contact.contact_radius_mm**2 / 10.0, 4), round(contact.peak_pressure_kpa, 4)
    (0.5, 0.7822)
    """
    radius = require_number("radius_mm", radius_mm, 1e-6, 1e6, hint="millimetres")
    force = require_number("force_mn", force_mn, 1e-12, 1e12, hint="millinewtons")
    contact = (3 * force * radius / (4 * _plane_strain(young_kpa, poisson))) ** (1 / 3)
    return HertzContact(force_mn=force, contact_radius_mm=contact, peak_pressure_kpa=1.5 * force / (np.pi * contact**2))


def punch_stiffness(*, radius_mm: float, young_kpa: float, poisson: float) -> float:
    """Force over indentation in mN/mm of a rigid flat round punch without friction on a half-space: ``2 E* a``.

    Parameters
    ----------
    radius_mm
        Radius a of the punch, mm, in [1e-6, 1e6].
    young_kpa, poisson
        The half-space: kPa in [1e-6, 1e12], and in [0, 0.4999].

    Examples
    --------
    >>> punch_stiffness(radius_mm=12.0, young_kpa=5.0, poisson=0.0)
    120.0
    """
    radius = require_number("radius_mm", radius_mm, 1e-6, 1e6, hint="millimetres")
    return 2 * _plane_strain(young_kpa, poisson) * radius


def punch_pressure_kpa(radius_mm: ArrayLike, *, punch_radius_mm: float, force_mn: float) -> NDArray[np.float64]:
    """Pressure under a flat punch, ``F / (2 pi a sqrt(a**2 - r**2))``: infinite at the edge.

    Parameters
    ----------
    radius_mm
        Radii, mm, any shape; the result is 0 at the edge and beyond it.
    punch_radius_mm
        Radius a of the punch, mm, in [1e-6, 1e6].
    force_mn
        Force, mN, in [0, 1e12].

    Examples
    --------
    >>> mean = 1000.0 / (np.pi * 12.0**2)
    >>> float(round(punch_pressure_kpa(0.0, punch_radius_mm=12.0, force_mn=1000.0) / mean, 3))
    0.5
    """
    edge = require_number("punch_radius_mm", punch_radius_mm, 1e-6, 1e6, hint="millimetres")
    force = require_number("force_mn", force_mn, 0.0, 1e12, hint="millinewtons")
    difference = edge**2 - np.asarray(radius_mm, dtype=float) ** 2
    inside = difference > 0
    root = np.sqrt(np.where(inside, difference, 1.0))
    return np.asarray(np.where(inside, force / (2 * np.pi * edge * root), 0.0))


def bonded_layer_ratio(radius_over_thickness: float, *, poisson: float) -> float:
    """Stiffness of a bonded layer over that of a half-space, under a rigid flat punch without friction.

    The stiffness is ``ratio * 2 E* a``. A function phi on the punch's radius gives the pressure's transform (Lebedev
    and Ufliand 1958). It solves a Fredholm equation of the second kind: with s = a / H and x in [0, 1]

        phi(x) - 2 s / pi int_0^1 phi(y) int_0^inf (1 - L(u)) cos(u s x) cos(u s y) du dy = 1,
        L(u) = (2 kappa sinh 2u - 4u) / (2 kappa cosh 2u + 4 u**2 + 1 + kappa**2),   kappa = 3 - 4 nu,

    and the ratio is the integral of phi.

    Parameters
    ----------
    radius_over_thickness
        Punch radius a over layer thickness H, in [0, 20].
    poisson
        Poisson's ratio, in [0, 0.4999].

    Raises
    ------
    InputError
        When a value lies outside its range.

    Examples
    --------
    >>> [round(bonded_layer_ratio(ratio, poisson=0.49), 3) for ratio in (0.01, 0.2, 1.0, 2.0)]
    [1.011, 1.274, 3.484, 8.337]
    """
    fraction = require_number("radius_over_thickness", radius_over_thickness, 0.0, 20.0)
    ratio = require_number("poisson", poisson, 0.0, LARGEST_POISSON)
    # The points resolve the fastest cosine, cos(u s) up to u = KERNEL_END, and phi's steep end under a wide punch.
    u, du = _gauss(0.0, KERNEL_END, 80 + int(8 * fraction))
    x, dx = _gauss(0.0, 1.0, 24 + int(8 * fraction))
    waves = np.cos(fraction * np.outer(x, u))
    kernel = 2 * fraction / np.pi * (waves * (du * _kernel_deficit(u, 3 - 4 * ratio))) @ waves.T
    phi = np.linalg.solve(np.eye(len(x)) - kernel * dx, np.ones(len(x)))
    return float(dx @ phi)


@dataclass(frozen=True, slots=True, kw_only=True)
class SphereInStress:
    """A bonded elastic sphere in an infinite body under uniaxial stress; stress and strain in it are uniform.

    Attributes
    ----------
    stress_ratio, strain_ratio
        Axial stress and axial strain in the sphere over those far from it.
    """

    stress_ratio: float
    strain_ratio: float


def sphere_in_uniaxial_stress(
    *, contrast: float, poisson: float, sphere_poisson: float | None = None
) -> SphereInStress:
    """Goodier's sphere (1933) by Eshelby's tensor (1957), which decouples the change of volume from that of shape.

    ``e_v = e_v0 / (1 + alpha (K_i / K - 1))`` and ``e' = e'0 / (1 + beta (G_i / G - 1))`` with
    ``alpha = (1 + nu) / (3 (1 - nu))`` and ``beta = 2 (4 - 5 nu) / (15 (1 - nu))``.

    Parameters
    ----------
    contrast
        Young's modulus of the sphere over that of the body, in [0, 1e9].
    poisson
        Poisson's ratio of the body, in [0, 0.4999].
    sphere_poisson
        Poisson's ratio of the sphere; the body's when None.

    Raises
    ------
    InputError
        When a value lies outside its range.

    Examples
    --------
    >>> sphere = sphere_in_uniaxial_stress(contrast=20.0, poisson=0.49)
    >>> round(sphere.stress_ratio, 5), round(sphere.strain_ratio, 5)
    (1.87451, 0.11453)
    """
    stiffer = require_number("contrast", contrast, 0.0, 1e9)
    nu = require_number("poisson", poisson, 0.0, LARGEST_POISSON)
    inner = nu if sphere_poisson is None else require_number("sphere_poisson", sphere_poisson, 0.0, LARGEST_POISSON)
    bulk, shear = 1 / (3 * (1 - 2 * nu)), 1 / (2 * (1 + nu))  # for a body of modulus 1 under a stress of 1
    bulk_in, shear_in = stiffer / (3 * (1 - 2 * inner)), stiffer / (2 * (1 + inner))
    alpha, beta = (1 + nu) / (3 * (1 - nu)), 2 * (4 - 5 * nu) / (15 * (1 - nu))
    volume = 1 / (3 * bulk) / (1 + alpha * (bulk_in / bulk - 1))
    shape = 1 / (3 * shear) / (1 + beta * (shear_in / shear - 1))
    return SphereInStress(stress_ratio=bulk_in * volume + 2 * shear_in * shape, strain_ratio=volume / 3 + shape)


def _stack(layers: Sequence[Layer]) -> Sequence[Layer]:
    if not layers or not all(isinstance(layer, Layer) for layer in layers):
        raise InputError(f"layers must contain at least one Layer; got {layers!r}")
    return layers


def _in_series(layers: Sequence[Layer], moduli: Sequence[float]) -> float:
    thickness = [layer.thickness_mm for layer in layers]
    return sum(thickness) / sum(part / modulus for part, modulus in zip(thickness, moduli, strict=True))


def _material(young_kpa: float, poisson: float) -> tuple[float, float]:
    young = require_number("young_kpa", young_kpa, 1e-6, 1e12, hint="kilopascals")
    return young, require_number("poisson", poisson, 0.0, LARGEST_POISSON)


def _plane_strain(young_kpa: float, poisson: float) -> float:
    young, ratio = _material(young_kpa, poisson)
    return young / (1 - ratio**2)


def _gauss(low: float, high: float, count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    x, w = (np.asarray(part, dtype=float) for part in legendre.leggauss(count))
    return (low + high) / 2 + (high - low) / 2 * x, (high - low) / 2 * w


def _kernel_deficit(u: NDArray[np.float64], kappa: float) -> NDArray[np.float64]:
    """``1 - L(u)`` without cancellation: the compliance that a bonded layer lacks against a half-space."""
    top = 2 * kappa * np.exp(-2 * u) + 4 * u**2 + 1 + kappa**2 + 4 * u
    return np.asarray(top / (2 * kappa * np.cosh(2 * u) + 4 * u**2 + 1 + kappa**2))
