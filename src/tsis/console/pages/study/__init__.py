"""Study: blinded studies, from the list of targets to the report."""

from tsis.console.pages.study.listing import listing
from tsis.console.pages.study.one import show_study

__all__ = ["listing", "show_study"]
