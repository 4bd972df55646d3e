"""How far small strain holds: the nominal strain of a press, and where it ends."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tsis.model import Probe

STRAIN_LIMIT = 0.3  # nominal; beyond it the linear model is only a guess


def nominal_strain(approach_mm: float, probe: Probe, thickness_mm: float) -> float:
    """Travel over what it squeezes: probe and slab, the slab no deeper than the face is wide."""
    return approach_mm / (probe.thickness_mm + min(thickness_mm, 2 * probe.radius_mm))


def strain_problem(approach_mm: float, probe: Probe, thickness_mm: float) -> str | None:
    """Why small strain does not describe a travel of the glass, or None."""
    strain = nominal_strain(approach_mm, probe, thickness_mm)
    if strain <= STRAIN_LIMIT:
        return None
    return (
        f"the glass would travel {approach_mm:.1f} mm, a strain of {strain:.2f}; small strain holds to {STRAIN_LIMIT:g}"
    )
