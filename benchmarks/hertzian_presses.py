"""Presses without a finite-element solution: Hertzian pressure over the contact radius of the estimator's own table.

For what does not depend on the mechanics. What judges an estimate of the modulus takes `benchmarks.hardness_bank`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.hardness.table import build_contact_table
from tsis.model.press import PressField

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.model.phantom import SoftSphere
    from tsis.model.probe import Probe


def hertzian_field(probe: Probe, contact_mm: float, force_n: float) -> PressField:
    """The press of a contact radius under a force."""
    radius = np.linspace(0.0, probe.radius_mm, 961)
    peak = 3e3 * force_n / (2 * np.pi * contact_mm**2)
    return PressField(
        radius_mm=radius,
        face_displacement_mm=np.zeros_like(radius),
        pressure_kpa=peak * np.sqrt(np.maximum(0.0, 1 - (radius / contact_mm) ** 2)),
        approach_mm=1.0,
        force_n=force_n,
    )


def by_table(probe: Probe, sphere: SoftSphere, *, forces_n: Sequence[float], resolution: object) -> list[PressField]:
    """Presses of a sphere, with the arguments and the answer of `press_fields`."""
    del resolution
    table = build_contact_table(probe)
    radii = np.exp(table.log_radius(sphere.young_kpa, sphere.poisson, sphere.radius_mm, np.array(forces_n)))
    return [hertzian_field(probe, float(a), force) for a, force in zip(radii, forces_n, strict=True)]
