"""Records: every target of the store, and one target with its presses and estimates."""

from tsis.console.pages.records.listing import listing
from tsis.console.pages.records.target import target_page

__all__ = ["listing", "target_page"]
