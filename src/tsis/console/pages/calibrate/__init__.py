"""Calibrate: sessions of guided steps, the frames of each, and the calibration made from them."""

from tsis.console.pages.calibrate._page import page, session_page

__all__ = ["page", "session_page"]
