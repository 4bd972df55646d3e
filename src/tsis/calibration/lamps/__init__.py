"""How bright the lamps are: read off a patch that no press reaches, and how they warm up."""

from tsis.calibration.lamps.patch import ReferencePatch, drift_corrected, patch_ratio
from tsis.calibration.lamps.warming import WarmUp, fit_warm_up

__all__ = [
    "ReferencePatch",
    "WarmUp",
    "drift_corrected",
    "fit_warm_up",
    "patch_ratio",
]
