"""About: what this console is, what it uses, and what may be done with it."""

from tsis.console.pages.about._page import about_page

__all__ = ["about_page"]
