"""The search for cameras: one at a time, with its last result."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from tsis.console.services._jobs import RUNNING
from tsis.instrument import CameraListing, find_cameras

if TYPE_CHECKING:
    from tsis.console.services._jobs import Job, Jobs, JobState


TITLE = "search for cameras"


class CameraSearch:
    """Searches as a job; a call during a search returns the running job.

    ``findings`` are those of the last search; None before the first is over.
    """

    def __init__(self, jobs: Jobs) -> None:
        self._jobs, self._lock = jobs, threading.Lock()
        self._job: Job | None = None
        self._findings: CameraListing | None = None

    @property
    def findings(self) -> CameraListing | None:
        """What the last search found; None before the first is over."""
        return self._findings

    def state(self) -> JobState | None:
        """How far the search under way or the last one is; None before the first."""
        job = self._job
        return None if job is None else job.state()

    def begin(self) -> Job:
        """Begin to search, or join who does."""
        with self._lock:
            if self._job is None or self._job.state().status != RUNNING:
                self._job = self._jobs.begin(TITLE, self._searched)
            return self._job

    def _searched(self, job: Job) -> CameraListing:
        self._findings = findings = find_cameras()
        job.say(found_text(findings))
        return findings


def found_text(findings: CameraListing) -> str:
    """How many there are."""
    number = len(findings.cameras)
    return {0: "No camera answered.", 1: "1 camera answered."}.get(number, f"{number} cameras answered.")
