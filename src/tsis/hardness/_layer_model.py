"""Force and dent by contact radius for a body on a gel, tabulated over the body's fraction of the compliance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.mechanics.gel import layer_contact

if TYPE_CHECKING:
    from typing import Literal

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

# Logarithms of force and dent over their small-strain values by dent/thickness, x² (1 - s), x⁶, x² with x the contact's
# radius over the body's and s the body's fraction of the compliance. Fitted to neo-Hookean bodies on neo-Hookean gels:
# 46 presses of spheres (tsis.mechanics.finite_strain), 88 of cylinders, x 0.2 to 0.65 (benchmarks/soft_cylinder.py).
FINITE_FORCE = {"sphere": (0.42, 0.055, 0.156, -0.066), "cylinder": (1.224, -0.44, 0.451, 0.189)}
FINITE_DENT = {"sphere": (-0.052, 0.289, 0.1045, -0.021), "cylinder": (0.384, -0.274, 0.233, 0.218)}
FORCE_MODEL_SD, DENT_MODEL_SD = 0.015, 0.02  # relative; RMS of those fits 0.011 and 0.016; of cylinders 0.011, 0.010
CYLINDER_MODEL_SD = 0.06  # times x², beside them: cylinders left out of the fit err by 0.03 at x = 0.63
SOFTNESS = np.concatenate([[0.0], 0.5 - 0.5 * np.cos(np.pi * (np.arange(20) + 0.5) / 20), [1.0 - 1e-9]])
STEP = 0.02  # of the logarithm of the contact radius, for slopes
DEPTH_RADII = 40  # contact radii of the table that is inverted where only the depth is known


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ContactCurves:
    """Logarithms of force and dent over `SOFTNESS`, and their slopes with the logarithm of the contact radius.

    ``log_force`` is that of force in N times the combined compliance in 1/kPa.
    """

    log_force: Floats
    log_dent: Floats
    force_slope: Floats
    dent_slope: Floats


def curves_at_radius(
    contact_mm: float, body: Literal["sphere", "cylinder"], radius_mm: float, thickness_mm: float, poisson: float
) -> ContactCurves:
    """The curves of a contact whose radius was measured."""
    steps = contact_mm * np.exp(STEP * np.array([-1.0, 0.0, 1.0]))[:, None]
    log_force, log_dent = _logarithms(steps, body, radius_mm, thickness_mm, poisson)
    return ContactCurves(
        log_force=log_force[1],
        log_dent=log_dent[1],
        force_slope=(log_force[2] - log_force[0]) / (2 * STEP),
        dent_slope=(log_dent[2] - log_dent[0]) / (2 * STEP),
    )


def curves_at_depth(
    depth_mm: float, body: Literal["sphere", "cylinder"], radius_mm: float, thickness_mm: float, poisson: float
) -> tuple[Floats, Floats]:
    """``log_force`` of a contact of which the dent was measured, and its slope with the logarithm of the dent."""
    radii = np.geomspace(0.01 * radius_mm, min(0.95 * radius_mm, 9.0 * thickness_mm), DEPTH_RADII)[:, None]
    log_force, log_dent = _logarithms(radii, body, radius_mm, thickness_mm, poisson)
    log_depth = np.log(depth_mm) + np.array([-STEP, 0.0, STEP])
    interpolated = np.array([np.interp(log_depth, log_dent[:, k], log_force[:, k]) for k in range(len(SOFTNESS))]).T
    return interpolated[1], (interpolated[2] - interpolated[0]) / (2 * STEP)


def _logarithms(
    contact_mm: Floats, body: Literal["sphere", "cylinder"], radius_mm: float, thickness_mm: float, poisson: float
) -> tuple[Floats, Floats]:
    """Logarithms of force times compliance and of the dent, shape (contacts, softnesses), at finite strain."""
    small = layer_contact(
        contact_mm,
        body=body,
        radius_mm=radius_mm,
        body_compliance=SOFTNESS,
        gel_compliance=1.0 - SOFTNESS,
        thickness_mm=thickness_mm,
        poisson=poisson,
    )
    log_force, log_dent = np.log(small.force / 1e3), np.log(small.dent_mm)
    x = contact_mm / radius_mm
    strains = np.broadcast_arrays(small.dent_mm / thickness_mm, x**2 * (1 - SOFTNESS), x**6, x**2)
    added = [
        sum(c * part for c, part in zip(fit, strains, strict=True)) for fit in (FINITE_FORCE[body], FINITE_DENT[body])
    ]
    return np.asarray(log_force + added[0]), np.asarray(log_dent + added[1])
