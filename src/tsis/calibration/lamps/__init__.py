"""Brightness of the lamps from a reference patch outside every contact, and their warm-up."""

from tsis.calibration.lamps._patch import LEAST_LIT, PixelBox, ReferencePatch, drift_corrected, patch_ratio, require_lit
from tsis.calibration.lamps._warm_up import WarmUp, fit_warm_up

__all__ = [
    "LEAST_LIT",
    "PixelBox",
    "ReferencePatch",
    "WarmUp",
    "drift_corrected",
    "fit_warm_up",
    "patch_ratio",
    "require_lit",
]
