"""Hardness: two presses on an object itself, and how stiff it is."""

from tsis.console.pages.hardness._page import HardnessPage

__all__ = ["HardnessPage"]
