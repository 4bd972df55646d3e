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
        self.findings: CameraListing | None = None

    def state(self) -> JobState | None:
        """State of the running or last search; None before the first."""
        job = self._job
        return None if job is None else job.state()

    def begin(self) -> Job:
        """Begin a search, or join the running one."""
        with self._lock:
            if self._job is None or self._job.state().status != RUNNING:
                self._job = self._jobs.begin(TITLE, self._searched)
            return self._job

    def _searched(self, job: Job) -> CameraListing:
        self.findings = findings = find_cameras()
        number = len(findings.cameras)
        job.say({0: "No camera answered.", 1: "1 camera answered."}.get(number, f"{number} cameras answered."))
        return findings
