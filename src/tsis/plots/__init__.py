"""Figures: every function takes a value and an ``ax`` and returns the ``ax``."""

from tsis.plots.force_curve import grey_sums
from tsis.plots.modes import mode_profiles
from tsis.plots.posterior import marginal, trade_off
from tsis.plots.profile import ring_profile
from tsis.plots.surface import relief
from tsis.plots.tactile import tactile_image
from tsis.plots.trials import trial_errors

__all__ = [
    "grey_sums",
    "marginal",
    "mode_profiles",
    "relief",
    "ring_profile",
    "tactile_image",
    "trade_off",
    "trial_errors",
]
