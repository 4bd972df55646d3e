"""What is believed of the tissue and its lumps before the scan."""

from __future__ import annotations

from dataclasses import dataclass

from tsis.errors import InputError
from tsis.model.require import require_number, require_pair

LEAST_CONTRAST = 2.0  # fainter lumps cannot be told from uneven tissue
TISSUE_KPA, THICKNESS_MM = (0.05, 2000.0), (5.0, 200.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class MapPrior:
    """Tissue and lumps of a scan.

    Parameters
    ----------
    tissue_young_kpa, tissue_young_sd
        Modulus of the tissue, and its relative standard deviation.
    thickness_mm, thickness_sd
        Thickness of the slab on its rigid support, and its relative standard deviation.
    poisson
        Poisson's ratio of tissue and lumps.
    diameter_mm
        Range of a lump's diameter; the logarithm is uniform in it.
    depth_mm
        Range of the depth of a lump's TOP under the skin; uniform.
    contrast
        Range of a lump's modulus over the tissue's, from 2 on: fainter ones cannot be told from uneven tissue. The
        logarithm is uniform in it.
    heterogeneity_sd
        Largest standard deviation of the logarithm of the tissue's modulus from place to place.
    lumps_per_scan
        Expected number of lumps under the scanned area.

    Raises
    ------
    InputError
        When a value lies outside its range.
    """

    tissue_young_kpa: float = 5.0
    tissue_young_sd: float = 0.1
    thickness_mm: float = 30.0
    thickness_sd: float = 0.05
    poisson: float = 0.49
    diameter_mm: tuple[float, float] = (5.0, 18.0)
    depth_mm: tuple[float, float] = (2.5, 20.0)
    contrast: tuple[float, float] = (2.0, 30.0)
    heterogeneity_sd: float = 0.45
    lumps_per_scan: float = 1.0

    def __post_init__(self) -> None:
        for name, low, high, hint in (
            ("tissue_young_kpa", *TISSUE_KPA, "kilopascals"),
            ("tissue_young_sd", 1e-3, 1.0, "a fraction"),
            ("thickness_mm", *THICKNESS_MM, "millimetres"),
            ("thickness_sd", 0.0, 0.5, "a fraction"),
            ("poisson", 0.3, 0.495, ""),
            ("heterogeneity_sd", 0.02, 0.6, ""),
            ("lumps_per_scan", 0.01, 30.0, ""),
        ):
            require_number(name, getattr(self, name), low, high, hint=hint)
        for name, least, most in (
            ("diameter_mm", 1.0, 60.0),
            ("depth_mm", 0.5, self.thickness_mm),
            ("contrast", LEAST_CONTRAST, 1000.0),
        ):
            low, high = require_pair(name, getattr(self, name))
            require_number(name, low, least, most)
            require_number(name, high, least, most)
            if not low < high:
                raise InputError(f"{name} must hold a low and a higher number; got {low:g} and {high:g}")
            object.__setattr__(self, name, (low, high))
