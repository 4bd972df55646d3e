"""Study: blinded studies, from the list of targets to the report."""

from tsis.console.pages.study.listing import listing
from tsis.console.pages.study.one import study_page

__all__ = ["listing", "study_page"]
