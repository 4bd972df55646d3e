"""Non-rigid point matching: correspondences of two point sets, and the map between them."""

from tsis.matching._fit import UNMATCHED, MatchFit, MatchMethod, NormalFrame
from tsis.matching._point_files import csv_text, read_points
from tsis.matching._posterior import RELIABLE, PosePosterior, probability_right, trust_features, trust_log_odds
from tsis.matching._registration import (
    METHODS,
    Alternative,
    Registration,
    fit_and_measures,
    match_points,
    register,
)
from tsis.matching._spline import ThinPlateSpline, fit_spline, spread_out

__all__ = [
    "METHODS",
    "RELIABLE",
    "UNMATCHED",
    "Alternative",
    "MatchFit",
    "MatchMethod",
    "NormalFrame",
    "PosePosterior",
    "Registration",
    "ThinPlateSpline",
    "csv_text",
    "fit_and_measures",
    "fit_spline",
    "match_points",
    "probability_right",
    "read_points",
    "register",
    "spread_out",
    "trust_features",
    "trust_log_odds",
]
