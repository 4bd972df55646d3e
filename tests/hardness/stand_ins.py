"""Presses without a finite-element solution: Hertzian pressure of the radius that some rule gives."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from benchmarks.hertzian_presses import by_table, hertzian_field

from tsis.hardness.table import build_contact_table

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from tsis.model.phantom import SoftSphere
    from tsis.model.press import PressField
    from tsis.model.probe import Probe


def wrong_by(
    errors: Sequence[float],
) -> Callable[..., list[PressField]]:
    """As `by_table`, with these relative errors of the contact radii."""

    def solve(probe: Probe, sphere: SoftSphere, *, forces_n: Sequence[float], resolution: object) -> list[PressField]:
        fields = by_table(probe, sphere, forces_n=forces_n, resolution=resolution)
        table = build_contact_table(probe)
        radii = np.exp(table.log_radius(sphere.young_kpa, sphere.poisson, sphere.radius_mm, np.array(forces_n)))
        return [
            hertzian_field(probe, float(a) * (1 + error), field.force_n)
            for a, error, field in zip(radii, errors, fields, strict=True)
        ]

    return solve


__all__ = ["by_table", "hertzian_field", "wrong_by"]
