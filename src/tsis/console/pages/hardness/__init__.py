"""Hardness: two presses on an object itself, and how stiff it is."""

from tsis.console.pages.hardness._page import hardness_tab

__all__ = ["hardness_tab"]
