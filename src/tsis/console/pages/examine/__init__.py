"""Examine: the live image, the press under it, what speaks against it, and what presses of this target tell."""

from tsis.console.pages.examine._page import SHORTCUTS, examine_page, snapshot_text

__all__ = ["SHORTCUTS", "examine_page", "snapshot_text"]
