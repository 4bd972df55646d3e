"""A sphere or cylinder pressed on a gel layer that is bonded to a rigid backing: force, dent and pressure by contact.

Small strain, frictionless. The body is a half-space with a parabolic face, as in Hertz's theory; the gel is a layer of
finite thickness. The pressure is a sum of ``(1 - r²/a²)^(m - 1/2)``, m = 1, 2, 3, which vanishes at the edge. Its
displacement of a half-space is a polynomial; what the backing takes off is an integral over wave numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Literal

import numpy as np
import scipy

from tsis.mechanics.gel._layer import layer_compliance
from tsis.model import require_number, require_one_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Floats = NDArray[np.float64]

BODIES = ("sphere", "cylinder")
LARGEST_RATIO = 10.0  # of contact radius and thickness
_ORDERS = np.arange(1, 4)  # of the terms of the pressure
_POWERS = _ORDERS - 0.5
_PLACES = np.sqrt((np.arange(8) + 0.5) / 8)  # of collocation, over the contact radius
_WAVES, _LAST_WAVE = 300, 18.0  # beyond this wave number times thickness, exp(-2 k t) is below 1e-15


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LayerContact:
    """Contacts of one body on a gel layer, for given contact radii; arrays have one shape.

    Attributes
    ----------
    force
        Force of a sphere in mN, or of a cylinder in mN per mm of its length.
    dent_mm
        How deep the gel's face lies below the untouched face at the middle of the contact.
    peak_kpa
        Pressure at the middle.
    """

    force: Floats
    dent_mm: Floats
    peak_kpa: Floats


def layer_contact(
    contact_radius_mm: ArrayLike,
    *,
    body: Literal["sphere", "cylinder"] = "sphere",
    radius_mm: ArrayLike,
    body_compliance: ArrayLike,
    gel_compliance: ArrayLike,
    thickness_mm: float,
    poisson: float,
) -> LayerContact:
    """Contact of a sphere, or of a long cylinder on its side, with a bonded gel layer.

    Parameters
    ----------
    contact_radius_mm
        Radius of the contact, or half its width for a cylinder, mm.
    body
        ``"sphere"`` or ``"cylinder"``.
    radius_mm
        Radius of the body, mm.
    body_compliance, gel_compliance
        ``(1 - nu²)/E`` of body and gel, 1/kPa; 0 for a rigid body. They broadcast with the radii.
    thickness_mm, poisson
        Of the gel; Poisson's ratio in [0, 0.4999].

    Raises
    ------
    InputError
        When a value is not positive or out of range, or the contact is more than 10 times as wide as the gel is thick.

    Examples
    --------
    A thick gel is a half-space: Hertz's law ``F = 4 E* a³ / (3 R)``.

    >>> contact = layer_contact(0.5, radius_mm=5.0, body_compliance=0.0, gel_compliance=0.01, thickness_mm=1e4,
    ...                         poisson=0.49)
    >>> round(float(contact.force), 6), round(float(contact.dent_mm), 5)
    (3.333333, 0.05)
    """
    require_one_of("body", body, BODIES)
    thickness_mm = require_number("thickness_mm", thickness_mm, 1e-3, 1e6, hint="millimetres")
    poisson = require_number("poisson", poisson, 0.0, 0.4999)
    values = {"contact_radius_mm": contact_radius_mm, "radius_mm": radius_mm}
    values |= {"body_compliance": body_compliance, "gel_compliance": gel_compliance}
    arrays = {name: np.asarray(value, dtype=float) for name, value in values.items()}
    for name, array in arrays.items():
        low = 0.0 if name == "body_compliance" else 1e-12
        for end in (array.min(initial=1.0), array.max(initial=1.0)):
            require_number(name, float(end), low, 1e9)
    contact, radius, soft, gel = np.broadcast_arrays(*arrays.values())
    require_number(
        "contact_radius_mm over thickness_mm", float(contact.max(initial=0.0)) / thickness_mm, 0.0, LARGEST_RATIO
    )
    flat = [array.ravel() for array in (contact, radius, soft, gel)]
    results = [_solve(body, *parts, thickness=thickness_mm, poisson=poisson) for parts in zip(*flat, strict=True)]
    force, dent, peak = (np.array(part).reshape(contact.shape) for part in zip(*results, strict=True))
    return LayerContact(force=force, dent_mm=dent, peak_kpa=peak)


def _solve(
    body: str, contact: float, radius: float, soft: float, gel: float, *, thickness: float, poisson: float
) -> tuple[float, float, float]:
    """Force, dent and peak pressure."""
    half, backing, middle = _displacements(body, contact / thickness, poisson)
    shape = contact * ((soft + gel) * half - gel * backing)  # displacement of both faces by unit pressures, mm/kPa
    system = np.column_stack([shape, -np.ones(len(_PLACES))])
    gap = -((contact * _PLACES) ** 2) / (2.0 * radius)
    pressure = np.linalg.lstsq(system, gap, rcond=None)[0][:-1]
    return float(_resultants(body, contact) @ pressure), float(contact * gel * middle @ pressure), float(pressure.sum())


def _resultants(body: str, contact: float) -> Floats:
    """Force of each term of the pressure at 1 kPa, in mN, or in mN per mm for a cylinder."""
    if body == "sphere":
        return np.asarray(np.pi * contact**2 / (_POWERS + 1.0))
    return np.asarray(contact * np.sqrt(np.pi) * _gamma(_POWERS + 1.0) / _gamma(_POWERS + 1.5))


@lru_cache(maxsize=4096)
def _displacements(body: str, ratio: float, poisson: float) -> tuple[Floats, Floats, Floats]:
    """Displacements by each term of the pressure, over the compliance ``(1 - nu²)/E`` and the contact radius.

    At the places of collocation those of a half-space and what the backing takes off, shape (places, terms), and at the
    middle that of the layer, shape (terms,). Those of a cylinder at the places are relative to the middle.
    """
    scale = max(ratio, 4.0 if body == "cylinder" else 0.0)  # the layer's own displacement needs shorter waves
    node, weight = np.polynomial.legendre.leggauss(_WAVES)
    wave, weight = _LAST_WAVE * scale * (node + 1.0) / 2.0, _LAST_WAVE * scale * weight / 2.0  # over the contact radius
    layer = layer_compliance(wave, young_kpa=1.0, poisson=poisson, thickness_mm=1.0 / ratio)
    factor = layer.normal * wave / (2.0 * (1.0 - poisson**2))  # over that of a half-space
    places = _PLACES[:, None]
    if body == "sphere":
        half = _half_space(places)
        order = _POWERS + 1.0
        transform = 2.0**_POWERS * _gamma(order) * scipy.special.jv(order, wave[:, None]) / wave[:, None] ** order
        missing = 2.0 * (weight * (1.0 - factor))[:, None] * transform
        return half, scipy.special.j0(places * wave) @ missing, _half_space(np.zeros((1, 1)))[0] - missing.sum(axis=0)
    half = -2.0 * np.column_stack(
        [
            places[:, 0] ** 2 / 2,
            3 * places[:, 0] ** 2 / 4 - places[:, 0] ** 4 / 4,
            15 * places[:, 0] ** 2 / 16 - 5 * places[:, 0] ** 4 / 8 + places[:, 0] ** 6 / 6,
        ]
    )
    order = _POWERS + 0.5
    bessel = scipy.special.jv(order, wave[:, None])
    transform = np.sqrt(np.pi) * _gamma(_POWERS + 1) * (2.0 / wave[:, None]) ** order * bessel / wave[:, None]
    backing = (np.cos(places * wave) - 1.0) @ ((weight * (1.0 - factor))[:, None] * transform)
    return half, 2.0 / np.pi * backing, 2.0 / np.pi * (weight * factor) @ transform


def _half_space(places: Floats) -> Floats:
    """Displacement of a half-space by the terms of the pressure, polynomials in the place (Weber and Schafheitlin)."""
    amplitude = np.sqrt(np.pi) * _gamma(_POWERS + 1.0) / _gamma(_POWERS + 1.5)
    return np.asarray(amplitude * scipy.special.hyp2f1(0.5, -_ORDERS, 1.0, places**2))


def _gamma(values: NDArray[np.floating]) -> Floats:
    return np.asarray(scipy.special.gamma(values))
