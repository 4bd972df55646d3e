"""Hardness: two presses on an object itself, and how stiff it is."""

from tsis.console.pages.hardness._page import page

__all__ = ["page"]
