"""Select camera: the virtual probe and what it presses, cameras that answer, the calibration and the force gauge."""

from tsis.console.pages.camera._page import camera_page

__all__ = ["camera_page"]
