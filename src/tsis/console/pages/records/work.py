"""A job of the bench on a page: how far it is, a way to end it, and what came out."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.bench.jobs import DONE
from tsis.console.pages.progress_bar import ProgressBar

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.console.bench import Job

EVERY_S = 0.3


def follow_job(job: Job, place: ui.element, done: Callable[[], None]) -> None:
    """Show a job in ``place`` until it is over, then clear the place and call ``done`` there, or say what went wrong.

    Parameters
    ----------
    job
        Under way.
    place
        Where it is shown; what was in it goes.
    done
        Shows what came out.
    """
    place.clear()
    with place, ui.element("div").classes("job").props('role="status"'):
        ui.label(job.title)
        bar = ProgressBar(job.title)
        count = ui.label().classes("muted")
        ui.button("End", on_click=job.end).props("dense no-caps outline")

    def look() -> None:
        state = job.state()
        if not state.running:
            timer.cancel()
            place.clear()
            with place:
                if state.status == DONE:
                    done()
                else:
                    ui.label(state.sentence).classes("flag").props('role="alert"')
            return
        bar.show(state)
        count.text = f"{state.done} of {state.total}" if state.total else "under way"

    with place:
        timer = ui.timer(EVERY_S, look)
