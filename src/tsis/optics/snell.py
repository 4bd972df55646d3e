"""Rays at flat interfaces: refraction, Fresnel's coefficients, and the angles at which a stack takes light in.

Angles of incidence are from the normal of an interface between layers; angles of acceptance are outside the stack,
from the normal of its end face. Both in degrees.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.model.check import require_array
from tsis.model.errors import InputError
from tsis.optics import inputs

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fresnel:
    """What a flat interface reflects and lets through.

    Attributes
    ----------
    r_s, r_p
        Reflected over incident amplitude of the electric field, complex, for light polarized across (s) and in (p) the
        plane of incidence; at normal incidence ``r_p = -r_s``. Beyond the critical angle their size is 1.
    t_s, t_p
        The same for the refracted wave, or for the evanescent one beyond the critical angle.
    reflected_s, reflected_p
        Share of the power reflected.
    transmitted_s, transmitted_p
        Share of the power let through: 0 beyond the critical angle.
    """

    r_s: NDArray[np.complex128]
    r_p: NDArray[np.complex128]
    t_s: NDArray[np.complex128]
    t_p: NDArray[np.complex128]
    reflected_s: NDArray[np.float64]
    reflected_p: NDArray[np.float64]
    transmitted_s: NDArray[np.float64]
    transmitted_p: NDArray[np.float64]


def refraction_deg(angle_deg: ArrayLike, *, index_from: float, index_to: float) -> NDArray[np.float64]:
    """Angle behind an interface by Snell's law, ``n_1 sin(a_1) = n_2 sin(a_2)``; NaN where all light is reflected.

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
    sine = np.sin(_incidence(angle_deg)) * _ratio(index_from, index_to)
    return np.degrees(np.arcsin(np.where(sine <= 1, sine, np.nan)))


def critical_angle_deg(*, index_from: float, index_to: float) -> float:
    """Angle of incidence above which all light is reflected; 90 where the other side is not thinner, so none ever is.

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
    # Written with the cosine, which keeps its digits along a grazing ray; imaginary beyond the critical angle.
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


def _incidence(angle_deg: Any) -> NDArray[np.float64]:
    """Angles of incidence in radians."""
    angle = np.asarray(angle_deg)
    flat = require_array("angle_deg", angle.ravel(), ndim=1)
    if not (flat.min() >= 0 and flat.max() <= 90):
        wrong = flat[(flat < 0) | (flat > 90)][0]
        raise InputError(f"angle_deg must lie in [0, 90]; got {wrong:g} (degrees from the interface's normal)")
    return np.asarray(np.radians(flat).reshape(angle.shape))


def _ratio(index_from: Any, index_to: Any) -> float:
    return inputs.require_refractive_index("index_from", index_from) / inputs.require_refractive_index(
        "index_to", index_to
    )
