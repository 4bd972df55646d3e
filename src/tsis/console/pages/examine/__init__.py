"""Examine: the live image, the press under it, what speaks against it, and what presses of this target tell."""

from tsis.console.pages.examine._page import KEYS, page
from tsis.console.pages.examine._press import kept_words

__all__ = ["KEYS", "kept_words", "page"]
