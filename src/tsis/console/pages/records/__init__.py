"""Records: every target of the store, and one target with its presses and estimates."""

from tsis.console.pages.records._listing import listing
from tsis.console.pages.records._target import target_page

__all__ = ["listing", "target_page"]
