"""Rays at interfaces: refraction, Fresnel's coefficients, acceptance, contact.

Angles of incidence are from the normal of an interface between layers; angles of acceptance are outside the stack,
from the normal of its end face. Both are in degrees. The checks of optical arguments, lengths in micrometres and real
refractive indices, stand here too.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy
from numpy.typing import NDArray

from tsis.errors import InputError
from tsis.model.require import require_array, require_number

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from tsis.model.probe import Led, Probe


Booleans = NDArray[np.bool]
Complexes = NDArray[np.complex128]
Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

SHORTEST_UM, LONGEST_UM = 0.1, 20.0
THINNEST_UM, THICKEST_UM = 1e-4, 1e6
LARGEST_INDEX = 5.0
OTHER_UNITS = {"metres": 1e6, "millimetres": 1e3, "nanometres": 1e-3}  # in micrometres


def require_wavelength(value: object) -> float:
    """Check a vacuum wavelength in micrometres; the message names another unit that would fit."""
    wavelength = require_number("wavelength_um", value, -np.inf, np.inf)
    if SHORTEST_UM <= wavelength <= LONGEST_UM:
        return wavelength
    for unit, factor in OTHER_UNITS.items():
        converted = wavelength * factor
        if SHORTEST_UM <= converted <= LONGEST_UM:
            cure = f" (that looks like {unit}; give {converted:g})"
            break
    else:
        cure = " (micrometres; green light is 0.55)"
    raise InputError(f"wavelength_um must lie in [{SHORTEST_UM:g}, {LONGEST_UM:g}]; got {wavelength:g}{cure}")


def require_refractive_index(name: str, value: object) -> float:
    """Check a real refractive index."""
    if isinstance(value, complex | np.complexfloating):
        raise InputError(f"{name} must be real, so without absorption or gain; got {value}")
    return require_number(name, value, 1.0, LARGEST_INDEX, hint="1 is vacuum")


def require_stack(index: Any, thickness_um: Any) -> tuple[Floats, Floats]:
    """Check the refractive index and the thickness in micrometres of each layer."""
    if np.iscomplexobj(index):
        raise InputError("index must be real, so without absorption or gain; got complex values")
    indices = require_array("index", index, ndim=1)
    thicknesses = require_array("thickness_um", thickness_um, ndim=1)
    if len(indices) != len(thicknesses):
        raise InputError(f"index and thickness_um must be of one length; got {len(indices)} and {len(thicknesses)}")
    for layer, value in enumerate(indices):
        require_refractive_index(f"index[{layer}]", float(value))
    for layer, value in enumerate(thicknesses):
        require_number(f"thickness_um[{layer}]", float(value), THINNEST_UM, THICKEST_UM, hint="micrometres")
    return indices, thicknesses


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fresnel:
    """Reflection and transmission of a flat interface.

    Attributes
    ----------
    r_s, r_p
        Reflected over incident amplitude of the electric field, complex, for light polarized across (s) and in (p) the
        plane of incidence; at normal incidence ``r_p = -r_s``. Their size is 1 beyond the critical angle.
    t_s, t_p
        The same for the refracted wave, or the evanescent wave beyond the critical angle.
    reflected_s, reflected_p
        Reflected fraction of the power.
    transmitted_s, transmitted_p
        Transmitted fraction of the power: 0 beyond the critical angle.
    """

    r_s: Complexes
    r_p: Complexes
    t_s: Complexes
    t_p: Complexes
    reflected_s: Floats
    reflected_p: Floats
    transmitted_s: Floats
    transmitted_p: Floats


def refraction_deg(angle_deg: ArrayLike, *, index_from: float, index_to: float) -> Floats:
    """Angle behind an interface by Snell's law, ``n_1 sin(a_1) = n_2 sin(a_2)``; NaN under total reflection.

    The dissertation's (3.60), (3.61), (3.62), (3.63) and (3.64) are this law at the five interfaces.

    Parameters
    ----------
    angle_deg
        Angle of incidence, degrees, in [0, 90], any shape.
    index_from, index_to
        Real refractive indices before and behind the interface, in [1, 5].

    Raises
    ------
    InputError
        When a value lies outside its range.

    Examples
    --------
    >>> refraction_deg([30.0, 60.0], index_from=1.5, index_to=1.0).round(3).tolist()
    [48.59, nan]
    """
    # (3.60), (3.61), (3.62), (3.63), (3.64): the sine behind the interface is n_1 / n_2 times the sine before it.
    sine = np.sin(_incidence(angle_deg)) * _ratio(index_from, index_to)
    return np.degrees(np.arcsin(np.where(sine <= 1, sine, np.nan)))


def critical_angle_deg(*, index_from: float, index_to: float) -> float:
    """Angle of incidence above which all light is reflected; 90 when the other index is not lower.

    Parameters
    ----------
    index_from, index_to
        Real refractive indices before and behind the interface, in [1, 5].

    Returns
    -------
    From the interface's normal, degrees.

    Raises
    ------
    InputError
        When an index lies outside its range.

    Examples
    --------
    >>> round(critical_angle_deg(index_from=1.41, index_to=1.0), 2)
    45.17
    """
    return float(np.degrees(np.arcsin(min(1.0, 1 / _ratio(index_from, index_to)))))


def fresnel(angle_deg: ArrayLike, *, index_from: float, index_to: float) -> Fresnel:
    """Fresnel's coefficients of an interface between two transparent bodies.

    Parameters
    ----------
    angle_deg
        Angle of incidence, degrees, in [0, 90], any shape.
    index_from, index_to
        Real refractive indices before and behind the interface, in [1, 5].

    Raises
    ------
    InputError
        When a value lies outside its range.

    Examples
    --------
    >>> glass = fresnel(0.0, index_from=1.0, index_to=1.5)
    >>> round(float(glass.reflected_s), 3), round(float(glass.transmitted_p), 3)
    (0.04, 0.96)
    """
    angle, ratio = _incidence(angle_deg), _ratio(index_from, index_to)
    before = np.cos(angle)
    # The cosine is accurate for grazing rays; the result is imaginary beyond the critical angle.
    behind = np.sqrt((1 - ratio) * (1 + ratio) + (ratio * before) ** 2 + 0j)
    s, p = ratio * before + behind, before + ratio * behind
    passing = 4 * ratio * before * behind.real
    r_s, r_p = (ratio * before - behind) / s, (before - ratio * behind) / p
    return Fresnel(
        r_s=r_s,
        r_p=r_p,
        t_s=2 * ratio * before / s,
        t_p=2 * ratio * before / p,
        reflected_s=np.abs(r_s) ** 2,
        reflected_p=np.abs(r_p) ** 2,
        transmitted_s=passing / np.abs(s) ** 2,
        transmitted_p=passing / np.abs(p) ** 2,
    )


def _incidence(angle_deg: Any) -> Floats:
    """Angles of incidence in radians."""
    angle = np.asarray(angle_deg)
    flat = require_array("angle_deg", angle.ravel(), ndim=1)
    if not (flat.min() >= 0 and flat.max() <= 90):
        wrong = flat[(flat < 0) | (flat > 90)][0]
        raise InputError(f"angle_deg must lie in [0, 90]; got {wrong:g} (degrees from the interface's normal)")
    return np.asarray(np.radians(flat).reshape(angle.shape))


def _ratio(index_from: Any, index_to: Any) -> float:
    return require_refractive_index("index_from", index_from) / require_refractive_index("index_to", index_to)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Acceptance:
    """Acceptance of each layer of a stack through the side wall, from air; layers from the pressed face up.

    Attributes
    ----------
    index
        Refractive index of each layer, (layers,).
    critical_deg
        Angle from the layers' normal above which a ray in that layer cannot leave the stack.
    acceptance_deg
        Angle from the side wall's normal below which a ray from outside stays in the stack, the dissertation's (3.67).
        It is 90 where the layer's index is so high that all rays from outside stay.
    unlimited
        Whether all rays stay.
    blind_deg
        Angle from the side wall's normal below which a layer of lower index reflects a ray before the pressed face; 0
        without such a layer.
    blind_fraction
        The same as a fraction of the angles, within the layer, at which a ray stays in the stack.
    """

    index: Floats
    critical_deg: Floats
    acceptance_deg: Floats
    unlimited: Booleans
    blind_deg: Floats
    blind_fraction: Floats


def acceptance(index: ArrayLike, *, index_outside: float = 1.0) -> Acceptance:
    """Angles of acceptance, ``asin(min(1, sqrt(n_i**2 - n_out**2)))``, of each layer, the dissertation's (3.67).

    The effective index ``N = n_i cos(a)`` of a ray at the angle a to the plane of the layers is equal in all layers.
    The ray stays in the stack when N exceeds the index outside, and passes a layer when N is below that layer's index.

    Parameters
    ----------
    index
        Real refractive indices from the pressed face up, in [1, 5], (layers,).
    index_outside
        Index below and above the stack, in [1, 5]; in front of the side wall there is air.

    Raises
    ------
    InputError
        When a value lies outside its range.

    Examples
    --------
    >>> acceptance([1.16, 1.15, 1.14, 1.13]).acceptance_deg.round(2).tolist()
    [36.01, 34.6, 33.19, 31.75]
    >>> acceptance([1.41, 1.515]).blind_deg.round(1).tolist()
    [0.0, 33.7]
    """
    indices = require_array("index", index, ndim=1)
    for layer, value in enumerate(indices):
        require_refractive_index(f"index[{layer}]", float(value))
    outside = require_refractive_index("index_outside", index_outside)
    # A ray enters through the side wall from air at the angle t to the wall's normal: sin(t) = n_i sin(a), with a its
    # angle to the plane of the layers. It stays where the faces reflect it totally: n_i cos(a) >= n_out. At the limit
    # sin(a) = sqrt(1 - (n_out / n_i)**2), so sin(t) = sqrt(n_i**2 - n_out**2): (3.67). Above 1, every ray stays.
    lowest = np.minimum.accumulate(indices)  # between a layer and the face
    aperture = _aperture(indices, np.full_like(indices, outside))
    stays, blind = (_grazing_deg(indices, least) for least in (np.full_like(indices, outside), lowest))
    return Acceptance(
        index=indices,
        critical_deg=90 - stays,
        acceptance_deg=np.degrees(np.arcsin(np.minimum(1, aperture))),
        unlimited=aperture >= 1,
        blind_deg=np.degrees(np.arcsin(np.minimum(1, _aperture(indices, np.maximum(lowest, outside))))),
        blind_fraction=np.divide(np.minimum(blind, stays), stays, out=np.zeros_like(stays), where=stays > 0),
    )


def layer_facing_lamp(probe: Probe, led: Led) -> int:
    """The layer at the height of a lamp's centre, from the pressed face up; the last is the glass."""
    tops = np.cumsum([layer.thickness_mm for layer in probe.layers])
    return int(np.searchsorted(tops, probe.led_height_mm(led), side="right"))


ERF_SLOPE = np.sqrt(np.pi) / 2  # erf(0.886 x) has the slope 1 at zero


def real_contact(pressure_kpa: Floats, saturation_kpa: float) -> Floats:
    """Fraction ``erf(0.886 p / saturation)`` of the face in real contact with asperities, zero under tension.

    Examples
    --------
    >>> real_contact(np.array([-1.0, 1.0, 100.0]), 20.0).round(3).tolist()
    [0.0, 0.05, 1.0]
    """
    return np.asarray(scipy.special.erf(ERF_SLOPE * np.maximum(pressure_kpa, 0.0) / saturation_kpa), dtype=float)


def _aperture(index: Floats, least: Floats) -> Floats:
    """Sine of the angle in air, before the side wall, of a ray whose effective index is ``least``: (3.67)."""
    return np.sqrt(np.maximum((index - least) * (index + least), 0))


def _grazing_deg(index: Floats, least: Floats) -> Floats:
    """Angle of that ray to the plane of the layers within its layer."""
    return np.degrees(np.arccos(np.minimum(1, least / index)))
