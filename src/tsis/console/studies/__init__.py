"""Blinded studies of a console: folders below its workspace, what is under way with them, and their reports."""

from tsis.console.studies.shelf import StudyGlimpse, StudyShelf
from tsis.console.studies.work import begin_publishing, begin_reading, job_of, unread

__all__ = ["StudyGlimpse", "StudyShelf", "begin_publishing", "begin_reading", "job_of", "unread"]
