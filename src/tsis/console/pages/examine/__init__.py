"""Examine: the live image, the press under it, what speaks against it, and what presses of this target tell."""

from tsis.console.pages.examine.layout import page

__all__ = ["page"]
