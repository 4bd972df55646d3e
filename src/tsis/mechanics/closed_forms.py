"""Closed forms: Hertz's contact, the modulus of a stack of layers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import InputError
from tsis.model.probe import Layer
from tsis.model.require import require_number

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from tsis.mechanics.mesh import Floats


LARGEST_POISSON = 0.4999


def effective_modulus_kpa(layers: Sequence[Layer]) -> float:
    """Modulus in kPa of the uniform bar that is as stiff as the stack: springs in series, free to spread sideways.

    ``E = sum(L) / sum(L / E)``, the dissertation's (3.78). It holds for Poisson's ratio 0 or for layers that slide on
    each other and on the glass. A bonded stack is stiffer.

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
    if not layers or not all(isinstance(layer, Layer) for layer in layers):
        raise InputError(f"layers must contain at least one Layer; got {layers!r}")
    # One pressure s passes through all layers, and a layer that may spread sideways shortens by s L / E. The stack
    # shortens by the sum, s sum(L / E). A uniform bar of modulus E of the whole length shortens by s sum(L) / E.
    # Both are equal where E = sum(L) / sum(L / E): (3.78).
    return sum(layer.thickness_mm for layer in layers) / sum(layer.thickness_mm / layer.young_kpa for layer in layers)


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

    def pressure_kpa(self, radius_mm: ArrayLike) -> Floats:
        """Pressure ``p0 sqrt(1 - r**2 / a**2)`` at ``radius_mm`` (any shape), zero outside the contact."""
        scaled = np.asarray(radius_mm, dtype=float) / self.contact_radius_mm
        return np.asarray(self.peak_pressure_kpa * np.sqrt(np.maximum(1 - scaled**2, 0.0)))


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
    young = require_number("young_kpa", young_kpa, 1e-6, 1e12, hint="kilopascals")
    modulus = young / (1 - require_number("poisson", poisson, 0.0, LARGEST_POISSON) ** 2)
    # The pressure p0 sqrt(1 - r**2 / a**2) dents a half-space by pi p0 (2 a**2 - r**2) / (4 a E*) inside the contact.
    # The sphere, as a paraboloid, asks for d - r**2 / (2 R). The terms in r**2 agree where p0 = 2 a E* / (pi R).
    # The pressure's sum over the contact is F = 2 pi a**2 p0 / 3. Both together: a**3 = 3 F R / (4 E*).
    contact = (3 * force * radius / (4 * modulus)) ** (1 / 3)
    return HertzContact(force_mn=force, contact_radius_mm=contact, peak_pressure_kpa=1.5 * force / (np.pi * contact**2))
