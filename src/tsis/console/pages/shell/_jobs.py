"""Jobs in the header: progress, results, and cancellation."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.components import ProgressBar
from tsis.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable

    from tsis.console.pages.components import Viewer
    from tsis.console.services import Instrument, InstrumentState, JobState


SHOWN = 8  # the newest


class JobList:
    """A button that shows running jobs, and their list; the camera's owner may end jobs."""

    def __init__(self, instrument: Instrument, viewer: Viewer) -> None:
        self._instrument, self._viewer = instrument, viewer
        self._rows: dict[str, _Row] = {}
        self._button = ui.button("Jobs").props('flat dense no-caps aria-haspopup="true"')
        with self._button, ui.menu().props('anchor="bottom right" self="top right"'):
            self._list = ui.element("ul").classes("job-list").props('aria-label="Jobs, the newest first"')
            with self._list:
                self._none = ui.element("li").classes("muted")
                with self._none:
                    ui.label("Nothing was begun yet.")

    def show(self, now: InstrumentState) -> None:
        """Show the newest jobs."""
        states = now.jobs[: -SHOWN - 1 : -1]
        self._button.text = _summary([state for state in now.jobs if state.running])
        self._none.set_visibility(not states)
        requested = {state.identity for state in states}
        for identity in [row for row in self._rows if row not in requested]:
            self._rows.pop(identity).item.delete()
        for index, state in enumerate(states):
            if state.identity not in self._rows:
                with self._list:
                    self._rows[state.identity] = _Row(state, self._end)
                self._rows[state.identity].item.move(target_index=index)
            self._rows[state.identity].show(state)

    async def _end(self, identity: str) -> None:
        if not self._viewer.commands:
            self._viewer.complain("only the camera's owner may end jobs; take the camera first")
            return
        await self._viewer.attempt(self._ended, identity)

    def _ended(self, identity: str) -> None:
        with suppress(InputError):  # it was forgotten meanwhile
            self._instrument.end_job(identity, by=self._viewer.identity)


class _Row:
    """One job."""

    def __init__(self, state: JobState, end: Callable[[str], Awaitable[None]]) -> None:
        self._shown: JobState | None = None
        with ui.element("li").classes("job-line") as self.item:
            with ui.element("div").classes("row"):
                ui.label(state.title).classes("strong")
                ui.element("div").classes("spring")
                self._text = ui.label().classes("muted")
                self._end = ui.button("End", on_click=lambda: end(state.identity)).props("flat dense no-caps")
                self._end.props["aria-label"] = f"End {state.title}"
            self._bar = ProgressBar(f"Progress of {state.title}")
            self._message = ui.label().classes("muted")

    def show(self, state: JobState) -> None:
        """Show how far it is."""
        if state == self._shown:
            return
        self._shown = state
        self._text.text = _progress(state) or ("under way" if state.running else state.status)
        self._end.set_visibility(state.running)
        self._bar.show(state)
        self._message.text = state.sentence
        self._message.set_visibility(bool(state.sentence))


def _summary(running: list[JobState]) -> str:
    if not running:
        return "Jobs"
    fraction = _progress(running[-1]) if len(running) == 1 else ""
    return f"Jobs: {fraction or len(running)}"


def _progress(state: JobState) -> str:
    return f"{100 * state.fraction:.0f} %" if state.total and state.running else ""
