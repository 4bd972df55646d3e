"""Figures: every function takes a value and the ``ax`` to draw it into, and returns the ``ax``."""

from tsis.plots._calibration import dot_board, force_residuals, force_sums, grey_sums, hysteresis_loops
from tsis.plots._detection import (
    agreement_limits,
    detected_by_size_and_depth,
    draw_scan_plan,
    drift_chart,
    read_over_true,
    reliability_diagram,
    roc_curve,
    scores_by_truth,
)
from tsis.plots._estimate import LABELS, design_errors, marginal, posterior, trade_off
from tsis.plots._hardness import contact_growth, contact_rows, modulus, modulus_readings
from tsis.plots._image import gel_contact, gel_depth, relief, ring_profile, tactile_image
from tsis.plots._matching import (
    TRIAL_COLOURS,
    alternative_pose,
    curves_over_levels,
    point_sets,
    trial_errors,
    warped_grid,
)
from tsis.plots._optics import (
    guide_index,
    guide_light,
    light_on_face,
    light_out_of_the_top,
    mode_profiles,
    probe_section,
    ray_picture,
)
from tsis.plots._section import tissue_section
from tsis.plots._sequences import light_over_time, light_path, repeated_readings

__all__ = [
    "LABELS",
    "TRIAL_COLOURS",
    "agreement_limits",
    "alternative_pose",
    "contact_growth",
    "contact_rows",
    "curves_over_levels",
    "design_errors",
    "detected_by_size_and_depth",
    "dot_board",
    "draw_scan_plan",
    "drift_chart",
    "force_residuals",
    "force_sums",
    "gel_contact",
    "gel_depth",
    "grey_sums",
    "guide_index",
    "guide_light",
    "hysteresis_loops",
    "light_on_face",
    "light_out_of_the_top",
    "light_over_time",
    "light_path",
    "marginal",
    "mode_profiles",
    "modulus",
    "modulus_readings",
    "point_sets",
    "posterior",
    "probe_section",
    "ray_picture",
    "read_over_true",
    "reliability_diagram",
    "relief",
    "repeated_readings",
    "ring_profile",
    "roc_curve",
    "scores_by_truth",
    "tactile_image",
    "tissue_section",
    "trade_off",
    "trial_errors",
    "warped_grid",
]
