"""Design: what a probe and its presses would tell, before they are built."""

from tsis.console.pages.design._page import design_tab

__all__ = ["design_tab"]
