"""Calibrate: sessions of guided steps, the frames of each, and the calibration made from them."""

from tsis.console.pages.calibrate._page import calibrate_page, session_page

__all__ = ["calibrate_page", "session_page"]
