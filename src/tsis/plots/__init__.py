"""Figures: every function takes a value and an ``ax`` and returns the ``ax``."""

from tsis.plots.design import design_errors
from tsis.plots.force_curve import grey_sums
from tsis.plots.modes import mode_profiles
from tsis.plots.posterior import marginal, trade_off
from tsis.plots.probe_section import probe_section
from tsis.plots.profile import ring_profile
from tsis.plots.propagation import guide_index, guide_light, light_out_of_the_top
from tsis.plots.rays import light_on_face, ray_picture
from tsis.plots.relative import repeated_readings
from tsis.plots.surface import relief
from tsis.plots.tactile import tactile_image
from tsis.plots.trials import trial_errors

__all__ = [
    "design_errors",
    "grey_sums",
    "guide_index",
    "guide_light",
    "light_on_face",
    "light_out_of_the_top",
    "marginal",
    "mode_profiles",
    "probe_section",
    "ray_picture",
    "relief",
    "repeated_readings",
    "ring_profile",
    "tactile_image",
    "trade_off",
    "trial_errors",
]
