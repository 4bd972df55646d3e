"""Jobs: the list in the header, and the page with the history."""

from __future__ import annotations

import re
from contextlib import suppress
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console import widgets
from tsis.console.services.jobs import DONE, ENDED, FAILED
from tsis.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Sequence

    from tsis.console.services.instrument import Instrument
    from tsis.console.services.jobs import JobState
    from tsis.console.services.state import InstrumentState
    from tsis.console.viewer import Viewer


SHOWN = 8  # the newest


class JobRows:
    """A list of jobs with their progress; the camera's owner may end them."""

    def __init__(self, instrument: Instrument, viewer: Viewer, place: ui.element, nothing: str) -> None:
        self._instrument, self._viewer, self._list = instrument, viewer, place
        self._rows: dict[str, _Row] = {}
        with place:
            self._none = ui.element("li").classes("muted")
            with self._none:
                ui.label(nothing)

    def show(self, states: Sequence[JobState]) -> None:
        """Show these jobs, in this order."""
        self._none.set_visibility(not states)
        shown = {state.identity for state in states}
        for identity in [row for row in self._rows if row not in shown]:
            self._rows.pop(identity).item.delete()
        for index, state in enumerate(states):
            if state.identity not in self._rows:
                with self._list:
                    self._rows[state.identity] = _Row(state, self._end)
                self._rows[state.identity].item.move(target_index=index)
            self._rows[state.identity].show(state)

    async def _end(self, identity: str) -> None:
        if not self._viewer.commands:
            self._viewer.complain("Only the user who controls the camera may cancel jobs: take the camera first.")
            return
        await self._viewer.attempt(self._ended, identity)

    def _ended(self, identity: str) -> None:
        with suppress(InputError):  # it was forgotten meanwhile
            self._instrument.end_job(identity, by=self._viewer.identity)


class JobList:
    """The header's button, which says how far running jobs are, and its list."""

    def __init__(self, instrument: Instrument, viewer: Viewer) -> None:
        self._button = ui.button("Jobs").props('flat dense aria-haspopup="dialog"').classes("jobs")
        with self._button, ui.menu().props('anchor="bottom right" self="top right" role=dialog') as menu:
            menu.props["aria-label"] = "Jobs"
            ui.link("All jobs and their history", "/jobs").classes("link job-history").on("click", menu.close)
            place = ui.element("ul").classes("job-list").props('aria-label="Jobs, the newest first"')
            self._rows = JobRows(instrument, viewer, place, "No jobs yet.")

    def show(self, now: InstrumentState) -> None:
        """Show the newest jobs."""
        self._button.text = _summary([state for state in now.jobs if state.running])
        self._rows.show(now.jobs[: -SHOWN - 1 : -1])


class _Row:
    """One job."""

    def __init__(self, state: JobState, end: Callable[[str], Awaitable[None]]) -> None:
        self._shown: JobState | None = None
        with ui.element("li").classes("job-line") as self.item:
            with ui.element("div").classes("row"):
                ui.label(state.title).classes("strong")
                ui.element("div").classes("spring")
                self._text = widgets.muted()
                self._end = widgets.button(
                    "Cancel",
                    lambda: end(state.identity),
                    look="flat dense",
                    label=f"Cancel {state.title}",
                )
            self._bar = widgets.ProgressBar(f"Progress of {state.title}")
            with ui.element("div").classes("row"):
                self._when = widgets.muted()
                if address := job_address(state.title):
                    ui.link("Open target", address).classes("link")
            self._message = widgets.muted()

    def show(self, state: JobState) -> None:
        """Show how far it is."""
        if state == self._shown:
            return
        self._shown = state
        self._text.text = _progress(state) or ("under way" if state.running else state.status)
        self._when.text = job_time(state)
        self._end.set_visibility(state.running)
        self._bar.show(state)
        self._message.text = state.sentence
        self._message.set_visibility(bool(state.sentence))


STATUSES = {DONE: "done", FAILED: "failed", ENDED: "cancelled"}
COLUMNS = (("began", "Began (UTC)"), ("title", "Job"), ("status", "Status"), ("took", "Took"), ("result", "Result"))
LINK = """<q-td :props="props">
  <a v-if="props.row.address" class="link" :href="props.row.address">{{ props.value }}</a>
  <template v-else>{{ props.value }}</template>
</q-td>"""


def jobs_page(instrument: Instrument, viewer: Viewer) -> None:
    """Build the page: what runs, and what was done by this run of the program and those before."""
    with ui.element("div").classes("stack"):
        with widgets.panel("Running"):
            place = ui.element("ul").classes("job-list wide")
            running = JobRows(instrument, viewer, place, "Nothing is running.")
        with widgets.panel("History"):
            widgets.muted("Jobs of this session and of earlier ones; a target's job links to its page.")
            columns = [{"name": name, "label": label, "field": name, "align": "left"} for name, label in COLUMNS]
            table = ui.table(rows=[], columns=columns, row_key="identity", pagination=10)
            table.props("flat dense").props["rows-per-page-label"] = "Jobs on a page"
            with table.add_slot("no-data"):
                widgets.muted("No job has finished yet.")
            table.add_slot("body-cell-title", LINK)

    def show(now: InstrumentState) -> None:
        running.show([state for state in reversed(now.jobs) if state.running])
        over = [state for state in now.jobs if not state.running]
        rows = [history_row(state) for state in (*instrument.jobs.history.past, *over)][::-1]
        if rows != table.rows:
            table.rows = rows

    viewer.follow(show)


def history_row(state: JobState) -> dict[str, str]:
    """A job that is over, as the table shows it."""
    known = state.began is not None and state.over is not None
    return {
        "identity": state.identity,
        "began": "" if state.began is None else f"{state.began:%Y-%m-%d %H:%M}",
        "title": state.title,
        "status": STATUSES.get(state.status, state.status),
        "took": f"{(state.over - state.began).total_seconds():.0f} s" if known else "",  # type: ignore[operator]
        "result": state.sentence,
        "address": job_address(state.title),
    }


def job_time(state: JobState) -> str:
    """When a job began, and how long it took; while it runs and its steps are counted, how long it will take.

    Examples
    --------
    >>> from datetime import UTC, datetime
    >>> from tsis.console.services.jobs import JobState
    >>> began, over = datetime(2026, 3, 1, 9, 5, tzinfo=UTC), datetime(2026, 3, 1, 9, 6, 30, tzinfo=UTC)
    >>> job_time(JobState(identity="a", title="estimate", status="done", began=began, over=over))
    'began 09:05 UTC, took 90 s'
    """
    if state.began is None:
        return ""
    began = f"began {state.began:%H:%M} UTC"
    if state.over is not None:
        return f"{began}, took {(state.over - state.began).total_seconds():.0f} s"
    passed_s = (datetime.now(UTC) - state.began).total_seconds()
    if 0.0 < state.fraction < 1.0:
        return f"{began}, about {passed_s * (1 / state.fraction - 1):.0f} s left"
    return began


def job_address(title: str) -> str:
    """The page of the target that a job's title ends with; empty where it names none.

    Examples
    --------
    >>> job_address("estimate of target 7"), job_address("import of a bundle")
    ('/records/7', '')
    """
    named = re.search(r"\btarget (\d+)$", title)
    return f"/records/{named[1]}" if named else ""


def _summary(running: list[JobState]) -> str:
    if not running:
        return "Jobs"
    progress = _progress(running[-1]) if len(running) == 1 else ""
    return f"Jobs: {progress or len(running)}"


def _progress(state: JobState) -> str:
    return f"{100 * state.fraction:.0f} %" if state.total and state.running else ""
