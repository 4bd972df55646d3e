"""Brightness of the lamps from a reference patch outside every contact, and their warm-up."""

from tsis.calibration.lamps._warm_up import (
    LEAST_LIT,
    PixelBox,
    ReferencePatch,
    WarmUp,
    drift_corrected,
    fit_warm_up,
    patch_ratio,
    require_lit,
)

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
