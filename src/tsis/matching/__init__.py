"""Non-rigid point matching: correspondences of two point sets, and the map between them."""

from typing import TYPE_CHECKING

import lazy_loader

from tsis.matching._fit import UNMATCHED, MatchFit, MatchMethod
from tsis.matching._point_files import csv_text, read_points
from tsis.matching._registration import METHODS, Alternative, Registration, match_points, register
from tsis.matching._spline import ThinPlateSpline, fit_spline, spread_out

__all__ = [
    "METHODS",
    "UNMATCHED",
    "Alternative",
    "MatchFit",
    "MatchMethod",
    "Registration",
    "ThinPlateSpline",
    "csv_text",
    "fit_spline",
    "match_points",
    "read_points",
    "register",
    "spread_out",
]

if not TYPE_CHECKING:  # subpackages load when they are first used
    __getattr__ = lazy_loader.attach(__name__, ["trials"])[0]
