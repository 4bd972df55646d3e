"""Study: blinded studies, from the list of targets to the report."""

from tsis.console.pages.study._listing import study_listing
from tsis.console.pages.study._study import show_study

__all__ = ["show_study", "study_listing"]
