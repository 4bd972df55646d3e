"""Blinded studies of a console: folders below its workspace, what is under way with them, and their reports."""

from tsis.console.studies._library import FORMS, StudyRepository, StudySummary, has_report, report_bytes, unblinded_text
from tsis.console.studies._work import begin_publishing, begin_reading, job_of, unread

__all__ = [
    "FORMS",
    "StudyRepository",
    "StudySummary",
    "begin_publishing",
    "begin_reading",
    "has_report",
    "job_of",
    "report_bytes",
    "unblinded_text",
    "unread",
]
