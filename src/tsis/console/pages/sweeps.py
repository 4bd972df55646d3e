"""Sweeps: many presses as one data set; started, watched, resumed and plotted."""

from __future__ import annotations

from datetime import timedelta
from functools import partial
from typing import TYPE_CHECKING

from nicegui import run, ui

from tsis.console.pages.components import (
    Redrawn,
    cell,
    loading,
    panel_title,
    rows_under,
    select_field,
    text_area,
    unit_field,
)
from tsis.console.pages.jobs import JobRows
from tsis.console.services import sweep_title
from tsis.errors import TsisError
from tsis.sweep import EXAMPLE

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    import numpy as np
    from numpy.typing import NDArray

    from tsis.console.pages.components import Viewer
    from tsis.console.services import Instrument, InstrumentState, Job, SweepState

__all__ = ["sweeps_page"]

EVERY_S = 2.0  # between two readings of the folder
SAYS = (
    "A plan names the probe, the ranges of tissue and inclusion, and the outputs. A process of its own computes the "
    "presses; a sweep that was ended, or cut off, resumes with its finished files."
)
FIRST_X, FIRST_Y = "young_kpa", "approach_mm"
GREY = "#7a8794"  # read on light and on dark ground


def sweeps_page(instrument: Instrument, viewer: Viewer) -> None:
    """Build the page."""
    SweepsPage(instrument, viewer)


class SweepsPage:
    """The sweeps of the workspace with their progress, the form of a new one, and a plot of one."""

    def __init__(self, instrument: Instrument, viewer: Viewer) -> None:
        self._instrument, self._viewer = instrument, viewer
        self._shown = ""  # name of the sweep in the plot
        self._rows: Mapping[str, NDArray[np.float64]] = {}
        with ui.element("div").classes("sweeps"):
            with ui.element("section").classes("panel stack"):
                panel_title("Sweeps")
                self._list = Redrawn(ui.element("div").classes("scroll"))
                running = JobRows(instrument, viewer, ui.element("ul").classes("job-list wide"), "None is under way.")
                self._plot = ui.element("div").classes("stack")
                with self._plot:
                    self._title = panel_title("", level=3)
                    with ui.element("div").classes("row"):
                        self._x = select_field([], label="Horizontal axis", on_change=self._draw)
                        self._y = select_field([], label="Vertical axis", on_change=self._draw)
                        for field in (self._x, self._y):
                            field.props("dense outlined").classes("sweep-axis")
                    self._chart = ui.echart(plot((), "", "")).classes("sweep-chart")
                    self._chart.props["role"] = "img"
                self._plot.set_visibility(False)
            with ui.element("section").classes("panel stack"):
                panel_title("New sweep")
                ui.label(SAYS).classes("muted")
                self._name = unit_field("Name", "first", keys="text")
                self._text = text_area("Plan", value=EXAMPLE).props("outlined input-class=sweep-plan")
                with ui.element("div").classes("row"):
                    self._cost = ui.button("How long?", icon="timer", on_click=self._ask_cost).props("no-caps outline")
                    self._start = ui.button("Start the sweep", icon="play_arrow", on_click=self._begin)
                    self._start.props("no-caps unelevated")
                self._answer = ui.label().classes("muted").props("role=status")

        def show(now: InstrumentState) -> None:
            running.show([job for job in now.jobs if job.running and job.title.startswith(sweep_title(""))])

        viewer.follow(show)
        viewer.every(EVERY_S, self._refresh)

    async def _refresh(self) -> None:
        found = await run.io_bound(self._instrument.sweeps.listed)
        if found is not None and self._list.changes_to(found):
            with self._list.element:
                self._list_sweeps(found)
            if self._shown:
                await self._open(self._shown)

    def _list_sweeps(self, found: Sequence[SweepState]) -> None:
        if not found:
            ui.label("No sweeps yet.").classes("muted")
            return
        with rows_under(("Sweep", "Presses", "Files", ""), label="Sweeps of the workspace"):
            for item in found:
                with ui.element("tr"):
                    cell(item.name)
                    if item.trouble:
                        with ui.element("td").props("colspan=3"):
                            ui.label(item.trouble).classes("doubtful wordy")
                        continue
                    cell(f"{item.presses:,}")
                    cell(f"{item.finished} of {item.shards}")
                    with ui.element("td"), ui.element("div").classes("row"):
                        buttons = [("Plot", self._open)] if item.finished else []
                        if not item.complete:
                            buttons.append(("Resume", self._resume))
                        for text, act in buttons:
                            button = ui.button(text, on_click=partial(act, item.name)).props("no-caps dense outline")
                            button.props["aria-label"] = f"{text} {item.name}"

    async def _ask_cost(self) -> None:
        with loading(self._cost):
            found = await self._viewer.attempt(self._instrument.sweeps.cost, self._text.value or "")
        if found is not None:
            plan, seconds = found
            self._answer.text = (
                f"{plan.presses:,} presses in {plan.shards} files, about {timedelta(seconds=round(seconds))} (h:min:s)."
            )

    async def _begin(self) -> None:
        name = (self._name.value or "").strip()
        with loading(self._start):
            job: Job | None = await self._viewer.attempt(self._instrument.sweeps.begin, name, self._text.value or "")
        if job is not None:
            self._viewer.notify(f"The sweep {name} is under way.")
            await self._refresh()

    async def _resume(self, name: str) -> None:
        await self._viewer.attempt(self._instrument.sweeps.resume, name)

    async def _open(self, name: str) -> None:
        """Read the finished rows of a sweep, and plot them."""
        try:
            rows = await run.io_bound(self._instrument.sweeps.rows, name)
        except TsisError as error:
            self._viewer.complain(str(error))
            return
        if not rows:
            return
        self._rows, self._shown = rows, name
        for field, first in ((self._x, FIRST_X), (self._y, FIRST_Y)):
            present = field.value if field.value in rows else first if first in rows else next(iter(rows))
            field.set_options(list(rows), value=present)
        self._plot.set_visibility(True)
        self._draw()

    def _draw(self) -> None:
        x, y = self._x.value, self._y.value
        if x not in self._rows or y not in self._rows:
            return
        points = tuple(zip(self._rows[x].tolist(), self._rows[y].tolist(), strict=True))
        self._title.text = f"{self._shown}: {y} over {x}"
        self._chart.options.update(plot(points, x, y))
        self._chart.props["aria-label"] = f"{len(points)} presses of {self._shown}: {y} over {x}"
        self._chart.update()


def plot(points: Sequence[tuple[float, float]], x: str, y: str) -> dict[str, Any]:
    """A scatter plot; refused presses, which are no numbers, are left out."""
    shown = [point for point in points if point[0] == point[0] and point[1] == point[1]]
    axis = {"type": "value", "scale": True, "nameLocation": "middle", "axisLabel": {"color": GREY}}
    name = {"color": GREY, "fontSize": 13}
    return {
        "animation": False,
        "grid": {"left": 70, "right": 24, "top": 24, "bottom": 56},
        "tooltip": {"trigger": "item"},
        "dataZoom": [{"type": "inside", "xAxisIndex": 0}, {"type": "inside", "yAxisIndex": 0}],
        "xAxis": {**axis, "name": x, "nameGap": 32, "nameTextStyle": name},
        "yAxis": {**axis, "name": y, "nameGap": 52, "nameTextStyle": name},
        "series": [{"type": "scatter", "symbolSize": 5, "data": shown}],
    }
