"""Was the probe held square? A press on plain tissue is the same all around, unless the probe leans."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.inclusion.harmonics import harmonic, shading_harmonics, unevenness
from tsis.inclusion.roundness import FEWEST, FIRST_RING, harmonic_variance
from tsis.model.estimate import IMPROBABLE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.inclusion.harmonics import Unevenness
    from tsis.inclusion.sectors import Sectors
    from tsis.model import Calibration

AXIS_MM = 0.1  # standard deviation of where in the picture the probe's axis is believed to be


def tilt_evidence(plain: Sectors, calibration: Calibration) -> Unevenness | None:
    """How far the first harmonic of a press on plain tissue is from noise; None when too few rings are whole.

    An axis believed at a slightly wrong place shifts the picture over the light: that is no tilt.
    """
    use = plain.usable
    use[:FIRST_RING] = False
    if use.sum() < FEWEST:
        return None
    grid, grey = plain.grid, plain.grey.mean(axis=1)
    radius = grid.ring_radius_mm
    lit = grid.light.sum(axis=1) / np.maximum(grid.count.sum(axis=1), 1)
    shifted = AXIS_MM * (np.gradient((grey * lit)[use], radius[use]) / lit[use]).astype(complex)
    growth, flux = harmonic(grid.growth_per_mm, 1)[use], harmonic(grid.flux, 1)[use]
    known = [shifted, 1j * shifted, *shading_harmonics(grey[use], growth, flux, radius[use])]
    variance = harmonic_variance(plain.grey, [plain], calibration, order=1)[:, use]
    return unevenness(harmonic(plain.grey, 1)[use], variance, radius[use], known=known)


def tilt_findings(references: Sequence[Sectors], calibration: Calibration) -> list[tuple[str, str]]:
    """Flag ``tilted`` for the reference press that leans most."""
    seen = [one for one in (tilt_evidence(plain, calibration) for plain in references) if one is not None]
    if not seen:
        return []
    worst = min(seen, key=lambda one: (one.chance, -one.over_noise))
    if worst.chance >= IMPROBABLE / len(seen):
        return []
    return [
        (
            "tilted",
            f"A reference press is not the same all around: {worst.radius_mm:.1f} mm from the axis one side is "
            f"brighter by {2 * worst.size_grey:.2g} grey levels, {worst.over_noise:.1f} times the noise; hold the "
            "probe square to the tissue, or check axis_px.",
        )
    ]
