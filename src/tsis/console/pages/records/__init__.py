"""Records: every target of the store, and one target with its presses and estimates."""

from tsis.console.pages.records._listing import target_listing
from tsis.console.pages.records._presses import compare_targets
from tsis.console.pages.records._target import show_target

__all__ = ["compare_targets", "show_target", "target_listing"]
