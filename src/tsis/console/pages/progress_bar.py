"""How far a job is: a bar that goes to and fro until anybody can tell."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

if TYPE_CHECKING:
    from tsis.console.bench import JobState


class ProgressBar:
    """The share of a job that is done; there only while it is under way.

    Parameters
    ----------
    label
        What the bar is to readers of the screen.
    """

    def __init__(self, label: str) -> None:
        self._bar = ui.linear_progress(0.0, show_value=False, size="6px").props("instant-feedback")
        self._bar.props["aria-label"] = label

    def show(self, job: JobState | None) -> None:
        """Show how far the job is; None is one that was never begun."""
        self._bar.set_visibility(job is not None and job.running)
        if job is not None and job.running:
            self._bar.value = job.share
            self._bar.props(remove="indeterminate") if job.share else self._bar.props(add="indeterminate")
