"""What is under way with a study, whoever began it, or was the last: how far it is, and a way to end it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.progress_bar import ProgressBar
from tsis.console.studies import job_of

if TYPE_CHECKING:
    from tsis.console.pages.study.context import StudyContext


class JobSeen:
    """Progress, sentence and a button that ends it.

    Parameters
    ----------
    page
        Of the study.
    """

    def __init__(self, page: StudyContext) -> None:
        self._page = page
        with ui.element("div").classes("stack tight") as self._place:
            with ui.element("div").classes("row"):
                self._sentence = ui.label().classes("wordy").props('role="status"')
                self._end = ui.button("End", on_click=self._ended).props("dense no-caps outline")
            self._bar = ProgressBar("Progress of the study")
        self._place.set_visibility(False)

    def look(self) -> bool:
        """Show how far it is, and return whether it is under way."""
        state = job_of(self._page.jobs, self._page.name)
        self._place.set_visibility(state is not None)
        if state is None:
            return False
        count = f" {state.done} of {state.total}." if state.running and state.total else ""
        self._sentence.text = f"{state.sentence or 'It begins when others are done.'}{count}"
        self._end.set_visibility(state.running)
        self._bar.show(state)
        return state.running

    def _ended(self) -> None:
        state = job_of(self._page.jobs, self._page.name)
        if state is not None and state.running:
            self._page.jobs.get(state.identity).end()


__all__ = ["JobSeen"]
