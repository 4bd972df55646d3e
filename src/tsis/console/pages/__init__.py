"""The pages: each is built by a call `page(instrument, viewer)`."""

from tsis.console.pages._directory import PAGES

__all__ = ["PAGES"]
