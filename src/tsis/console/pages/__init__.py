"""The pages: one file a page, each built from the bench's state by a call `page(bench, viewer)`."""

from tsis.console.pages._directory import PAGES

__all__ = ["PAGES"]
