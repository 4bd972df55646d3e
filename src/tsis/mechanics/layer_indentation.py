"""A rigid ball, flat punch or cone pressed on a bonded or sliding layer.

Small strain, frictionless face. The pressure's Hankel transform is ``(E*/pi) int_0^a chi(x) cos(kx) dx``; contact up to
the radius ``a`` then asks, after Abel's transform (Sneddon 1965; Dhaliwal and Rau 1970), for

    chi(x) - (2/pi) int_0^a chi(s) int_0^inf (1 - L(kt)) cos(kx) cos(ks) dk ds = depth - f(x),

with ``L`` the layer's compliance over that of a half-space, which is 1 for a thick layer, and ``f`` the indenter's:
``x/2 ln((R + x)/(R - x))`` for a ball, ``pi/2 x cot(angle)`` for a cone, 0 for a punch. The force is ``2 E* int_0^a
chi``. At the edge of a round contact the pressure vanishes: ``chi(a) = 0`` gives the depth.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from tsis.mechanics.gel.contact import layer_compliance
from tsis.model.require import require_number, require_one_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

INDENTERS = ("ball", "punch", "cone")
BASES = ("bonded", "sliding")
WIDEST_BALL = 0.9  # contact radius over the ball's radius
THINNEST = 0.05  # thickness over the contact radius
_NODES, _WAVES, _LAST_WAVE = 32, 240, 20.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class IndentationCurve:
    """Force over depth of a rigid indenter; arrays have one shape and ascend.

    Attributes
    ----------
    depth, contact
        Depth and contact radius in terms of the radius of ball or punch; of a cone, of the layer's thickness.
    force
        Force over ``E / (1 - nu²)`` and the square of that length.
    """

    depth: Floats
    contact: Floats
    force: Floats


@lru_cache(maxsize=512)
def indentation_curve(
    indenter: str, *, thickness: float, poisson: float, base: str = "bonded", half_angle_deg: float = 45.0
) -> IndentationCurve:
    """Curve of a rigid indenter on a layer, in terms of the indenter's radius; of a cone in terms of the thickness.

    Parameters
    ----------
    indenter
        ``"ball"``, ``"punch"`` (flat, round) or ``"cone"``.
    thickness
        Of the layer over the radius of ball or punch; without meaning for a cone. Infinite for a half-space.
    poisson
        Of the layer, in [0, 0.4999].
    base
        ``"bonded"`` to a rigid base, or ``"sliding"`` on it without friction.
    half_angle_deg
        Of the cone, between axis and side.

    Raises
    ------
    InputError
        When a value lies outside its range.

    Examples
    --------
    A small ball on a thick layer obeys Hertz's law ``4/3 depth^1.5``.

    >>> curve = indentation_curve("ball", thickness=1e6, poisson=0.5)
    >>> force = np.interp(1e-3, curve.depth, curve.force)
    >>> round(float(force / (4 / 3 * 1e-3**1.5)), 2)
    1.0
    """
    require_one_of("indenter", indenter, INDENTERS)
    require_one_of("base", base, BASES)
    require_number("poisson", poisson, 0.0, 0.5)
    require_number("half_angle_deg", half_angle_deg, 5.0, 89.0, hint="degrees")
    if np.isinf(thickness):
        thickness = 1e9
    require_number("thickness over radius", thickness, THINNEST, 1e9)
    compliance = _compliance(min(poisson, 0.4999), base)
    if indenter == "punch":
        depth = np.array([0.0, 1e-3, 10.0])
        (_, flat), _ = _solved(1.0, thickness, compliance, np.zeros_like)
        return IndentationCurve(depth=depth, contact=np.ones(3), force=depth * flat)
    if indenter == "cone":
        thickness = 1.0
        radii = np.concatenate([[0.0], np.geomspace(1e-4, 4.0, 60)])
        slope = np.pi / 2 / np.tan(np.radians(half_angle_deg))
        face: Callable[[Floats], Floats] = lambda x: slope * x  # noqa: E731
    else:
        widest = min(WIDEST_BALL, thickness / THINNEST)
        radii = np.concatenate([[0.0], np.geomspace(2e-3, widest, 60)])
        face = lambda x: x / 2 * np.log((1 + x) / (1 - x))  # noqa: E731
    depths, forces = [0.0], [0.0]
    for contact in radii[1:].tolist():
        (edge_flat, flat), (edge_face, shaped) = _solved(contact, thickness, compliance, face)
        reached = float(edge_face / edge_flat)  # chi(a) = 0
        depths.append(reached)
        forces.append(float(reached * flat - shaped))
    return IndentationCurve(depth=np.array(depths), contact=radii, force=np.array(forces))


def _solved(
    contact: float, thickness: float, compliance: Callable[[Floats], Floats], face: Callable[[Floats], Floats]
) -> tuple[tuple[float, float], tuple[float, float]]:
    """``chi(a)`` and force over ``E*`` for a unit depth, and for the indenter's face."""
    node, weight = np.polynomial.legendre.leggauss(_NODES)
    place, weight = contact * (node + 1) / 2, contact * weight / 2
    wave, share = np.polynomial.legendre.leggauss(_WAVES)
    wave, share = _LAST_WAVE * (wave + 1) / 2, _LAST_WAVE * share / 2
    missing = share * (1 - compliance(wave)) / thickness
    ends = np.append(place, contact) / thickness
    waves = np.cos(np.outer(ends, wave))
    kernel = 2 / np.pi * (waves * missing) @ waves[:-1].T * weight
    right = np.column_stack([np.ones(_NODES + 1), face(np.append(place, contact))])
    chi = np.linalg.solve(np.eye(_NODES) - kernel[:-1], right[:-1])
    edge = right[-1] + kernel[-1] @ chi
    force = 2 * weight @ chi
    return (float(edge[0]), float(force[0])), (float(edge[1]), float(force[1]))


def _compliance(poisson: float, base: str) -> Callable[[Floats], Floats]:
    """Compliance of a layer of unit thickness over that of a half-space, at wave numbers."""
    if base == "sliding":
        return lambda wave: (np.cosh(2 * wave) - 1) / (np.sinh(2 * wave) + 2 * wave)

    def bonded(wave: Floats) -> Floats:
        layer = layer_compliance(wave, young_kpa=1.0, poisson=poisson, thickness_mm=1.0)
        return np.asarray(layer.normal * wave / (2 * (1 - poisson**2)))

    return bonded
