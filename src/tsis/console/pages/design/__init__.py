"""Design: what a probe and its presses would tell, before they are built."""

from tsis.console.pages.design._page import page

__all__ = ["page"]
