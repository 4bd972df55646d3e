"""The lit part that (6.1) counts, and the centroid (6.7), (6.8) of its light."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from tsis.inclusion.shape_binary import binary_features
from tsis.model.check import require_number

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.inclusion.relative_frames import LightChange

SOURCE_THRESHOLD = 5.0 / 255.0  # of full scale: the source's k = 5 of 8 bits
LEAST_WIDTH_PX = 5.0  # the blur makes a disc of about half this width of one noisy pixel


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LitPart:
    """The largest connected part of a change above a threshold; there is one inclusion, and the rest is noise.

    Attributes
    ----------
    mask
        True inside, shape (rows, columns); False everywhere when nothing is lit.
    area_mm2, diameter_mm
        Its area (6.1), and the diameter of the disc of that area (6.2).
    centroid_px
        Mean position (x, y) of its light, weighted by grey level, (6.7) and (6.8); None when nothing is lit.
    total_grey
        Sum of its grey levels.
    threshold_grey
        The level above which pixels were counted.
    flags
        What is wrong with it.
    """

    mask: NDArray[np.bool]
    area_mm2: float
    diameter_mm: float
    centroid_px: tuple[float, float] | None
    total_grey: float
    threshold_grey: float
    flags: tuple[str, ...]


def lit_part(change: LightChange, threshold_grey: float | None) -> LitPart:
    """Count the pixels brighter than ``threshold_grey``, 5 of 255 levels when None."""
    full_scale = change.image.full_scale
    least = SOURCE_THRESHOLD * full_scale if threshold_grey is None else threshold_grey
    require_number("threshold_grey", least, 1e-6 * full_scale, full_scale, hint="above zero")
    found = binary_features(change.image, least)
    lit = found.contact and found.equivalent_diameter_px >= LEAST_WIDTH_PX
    mask = found.patch.mask & lit
    wrong = {
        "no_contact": not lit,
        "cropped": lit and found.cropped,
        "saturated": bool(change.clipped[mask].any()),
        "noisy": change.is_drowned(least),
    }
    light = np.where(mask, np.maximum(change.image.grey, 0.0), 0.0)
    row, column = ndimage.center_of_mass(light) if lit else (0.0, 0.0)
    return LitPart(
        mask=mask,
        area_mm2=(found.area_mm2 or 0.0) * lit,
        diameter_mm=(found.equivalent_diameter_mm or 0.0) * lit,
        centroid_px=(float(column), float(row)) if lit else None,
        total_grey=float(light.sum()),
        threshold_grey=float(least),
        flags=tuple(flag for flag, is_so in wrong.items() if is_so),
    )
