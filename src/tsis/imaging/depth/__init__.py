"""Depth maps of gel sensors: calibration by presses of a known ball, gradients, integration, files."""

from tsis.imaging.depth._calibration import (
    DEPTH_METHODS,
    DepthCalibration,
    calibrate_depth,
    depth_calibration_json,
    parse_depth_calibration,
)
from tsis.imaging.depth._gradients import GRADIENT_DEGREE, polynomial_features
from tsis.imaging.depth._map import DepthMap, DepthMapper, cap_error_mm, integrate_gradients

__all__ = [
    "DEPTH_METHODS",
    "GRADIENT_DEGREE",
    "DepthCalibration",
    "DepthMap",
    "DepthMapper",
    "calibrate_depth",
    "cap_error_mm",
    "depth_calibration_json",
    "integrate_gradients",
    "parse_depth_calibration",
    "polynomial_features",
]
