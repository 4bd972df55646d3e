"""The estimate of the present target, whoever began it on whichever page."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.console.bench.estimates import estimate_title

if TYPE_CHECKING:
    from tsis.console.bench import BenchState, JobState


def estimate_job(state: BenchState) -> JobState | None:
    """The newest estimate of the present target, under way or over; None when there was none."""
    title = estimate_title(state.target)
    return next((job for job in reversed(state.jobs) if job.title == title), None)
