"""Pixel scale: millimetres on the face per pixel, along each axis of the image."""

from tsis.calibration.scale._ball import BallDiagnostics, axis_ratio_from_ball, scale_from_ball
from tsis.calibration.scale._dots import DotDiagnostics, scale_from_dots
from tsis.calibration.scale._value import PixelScale

__all__ = [
    "BallDiagnostics",
    "DotDiagnostics",
    "PixelScale",
    "axis_ratio_from_ball",
    "scale_from_ball",
    "scale_from_dots",
]
