"""Non-rigid matching of points: which point of one set belongs to which of another, and the map between them."""

from tsis.matching.registration import METHODS, Registration, match_points, register
from tsis.matching.spline import ThinPlateSpline, fit_spline

__all__ = ["METHODS", "Registration", "ThinPlateSpline", "fit_spline", "match_points", "register"]
