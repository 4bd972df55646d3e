"""The button of the estimate, and how far it is."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.bench.jobs import FAILED
from tsis.console.pages.classed import classed
from tsis.console.pages.field_words import in_words
from tsis.console.pages.hardness.flow import BALL, HARDNESS, kept
from tsis.console.pages.headings import panel_title
from tsis.console.pages.progress_bar import ProgressBar

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.console.bench import Bench, JobState
    from tsis.console.pages.hardness.object_part import TypedRadius
    from tsis.console.pages.viewer import Viewer

WORDS = {
    "radius_mm": "radius of the object",
    "radius_sd_mm": "its standard deviation",
    "reference_radius_mm": "radius of the ball",
}


class Estimating:
    """Begins the estimate.

    Parameters
    ----------
    bench, viewer
        As of the page's other parts.
    radius, ball_radius
        Tell what was typed; `InputError` when it is none.
    """

    def __init__(
        self, bench: Bench, viewer: Viewer, radius: Callable[[], TypedRadius], ball_radius: Callable[[], float]
    ) -> None:
        self._bench, self._viewer, self._radius, self._ball_radius = bench, viewer, radius, ball_radius
        with ui.element("div").classes("panel stack tight"):
            with ui.element("div").classes("row"):
                panel_title("3  Estimate")
                ui.element("div").classes("spring")
                self._button = ui.button("Estimate", icon="analytics", on_click=self._begin)
                self._button.props("no-caps unelevated")
            self._bar = ProgressBar("Progress of the estimate")
            self._said = ui.label().classes("muted").props("role=status")

    def show(self, job: JobState | None, *, enough: bool, two: bool) -> None:
        """Show whether it can begin, and how far it is."""
        running = job is not None and job.running
        failed = job is not None and job.status == FAILED
        self._button.set_enabled(enough and not running)
        self._bar.show(job)
        if running:
            words = "The contact of a probe that was never used before is solved once, which takes some minutes."
        elif job is not None and failed:
            words = in_words(job.sentence, WORDS)
        else:
            words = "" if two or not enough else "One press tells nearly as much, but nothing tests it."
        self._said.text = words
        classed(self._said, "doubtful", failed)

    async def _begin(self) -> None:
        await self._viewer.attempt(self._begun)

    def _begun(self) -> object:
        number = self._bench.state().target
        found = kept(self._bench.store, number)
        typed = self._radius()
        options = {"radius_mm": typed.radius_mm, "radius_sd_mm": typed.sd_mm}
        if any(press.role == BALL for press in found.presses):
            options["reference_radius_mm"] = self._ball_radius()
        return self._bench.estimate(
            number,
            kind=HARDNESS,
            presses=[press.id for press in found.presses] or None,
            options={name: value for name, value in options.items() if value is not None},
        )
