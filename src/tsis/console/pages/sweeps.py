"""Sweeps: many presses as one data set; started, watched, resumed and plotted."""

from __future__ import annotations

from datetime import timedelta
from functools import partial
from typing import TYPE_CHECKING

from nicegui import run, ui

from tsis.console.pages import components as kit
from tsis.console.pages.jobs import JobRows
from tsis.console.services import sweep_title, varying_columns
from tsis.sweep.plan import EXAMPLE

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from tsis.console.services import Instrument, SweepState

SAYS = "The presses are computed in a separate process. A cancelled sweep resumes from its finished files."
SWEEP = sweep_title("")
GREY = "#7a8794"  # read on light and on dark ground


class SweepsPage:
    """The sweeps of the workspace with their progress, the form of a new one, and a plot of one."""

    def __init__(self, instrument: Instrument, viewer: kit.Viewer) -> None:
        self._sweeps, self._viewer = instrument.sweeps, viewer
        self._shown = ""  # name of the sweep in the plot
        self._rows: Mapping[str, Any] = {}
        with ui.element("div").classes("sweeps"):
            with kit.panel("Sweeps"):
                self._list = kit.Redrawn(ui.element("div").classes("scroll"))
                running = JobRows(instrument, viewer, ui.element("ul").classes("job-list wide"), "No sweep is running.")
                with ui.element("div").classes("stack") as self._plot:
                    self._title = kit.panel_title("", level=3)
                    with ui.element("div").classes("row"):
                        self._x, self._y = (
                            kit.select_field([], label=label, on_change=self._draw)
                            for label in ("Horizontal axis", "Vertical axis")
                        )
                    self._place = ui.element("div")
                    self._chart: ui.echart | None = None  # made for the first plot: its library is large
                self._plot.set_visibility(False)
            with kit.panel("New sweep"):
                kit.muted(SAYS)
                self._name = kit.unit_field("Name", "first", keys="text")
                self._text = kit.text_area("Plan", value=EXAMPLE).props("input-class=sweep-plan")
                with ui.element("div").classes("row"):
                    self._cost = kit.button("Estimate size and time", self._ask_cost, icon="timer")
                    self._start = kit.button("Start the sweep", self._begin, icon="play_arrow", look="unelevated")
                self._answer = kit.status()

        viewer.follow(lambda now: running.show([job for job in now.jobs if job.running and SWEEP in job.title]))
        viewer.every(2.0, self._refresh)

    async def _refresh(self) -> None:
        found = await run.io_bound(self._sweeps.listed)
        if found is not None and self._list.changes_to(found):
            with self._list.element:
                self._list_sweeps(found)
            if self._shown:
                await self._open(self._shown)

    def _list_sweeps(self, found: Sequence[SweepState]) -> None:
        with kit.rows_under(("Sweep", "Presses", "Files", ""), label="Sweeps of the workspace"):
            for item in found:
                with ui.element("tr"):
                    kit.cell(item.name)
                    kit.cell(item.trouble or f"{item.presses:,}")
                    kit.cell(f"{item.finished} of {item.shards}")
                    resume = partial(self._viewer.attempt, self._sweeps.resume, item.name)
                    with ui.element("td"), ui.element("div").classes("row"):
                        for text, act, useful in (
                            ("Plot", partial(self._open, item.name), item.finished > 0),
                            ("Resume", resume, not item.complete and not item.trouble),
                        ):
                            if useful:
                                kit.button(text, act, look="outline dense", label=f"{text} {item.name}")

    async def _ask_cost(self) -> None:
        with kit.loading(self._cost):
            found = await kit.submit(self._viewer, {"": self._text}, self._sweeps.cost, self._text.value or "")
        if found is not None:
            plan, lasts = found[0], timedelta(seconds=round(found[1]))
            self._answer.text = f"{plan.presses:,} presses in {plan.shards} files, about {lasts} (h:min:s)."

    async def _begin(self) -> None:
        name = (self._name.value or "").strip()
        with kit.loading(self._start):
            fields = {"name": self._name, "": self._text}
            job = await kit.submit(self._viewer, fields, self._sweeps.begin, name, self._text.value or "")
        if job is not None:
            self._viewer.notify(f"Sweep {name} started.")
            await self._refresh()

    async def _open(self, name: str) -> None:
        """Read the finished rows of a sweep, and plot them."""
        if not (rows := await self._viewer.attempt(self._sweeps.rows, name)):
            return
        self._rows, self._shown, varied = rows, name, varying_columns(rows)
        for field, firsts in ((self._x, varied), (self._y, ["approach_mm", *varied])):
            used = (*(name for name in (field.value, *firsts) if name in varied), *rows)
            field.set_options(list(rows), value=used[0])
        self._plot.set_visibility(True)
        self._draw()

    def _draw(self) -> None:
        x, y = self._x.value, self._y.value
        if not {x, y} <= set(self._rows):
            return
        points = tuple(zip(self._rows[x].tolist(), self._rows[y].tolist(), strict=True))
        if self._chart is None:
            with self._place:
                self._chart = ui.echart(plot((), "", "")).classes("sweep-chart").props("role=img")
        self._title.text = self._chart.props["aria-label"] = f"{self._shown}: {y} over {x}, {len(points)} presses"
        self._chart.options.update(plot(points, x, y))
        self._chart.update()


def plot(points: Sequence[tuple[float, float]], x: str, y: str) -> dict[str, Any]:
    """A scatter plot; refused presses, which are no numbers, are left out."""
    shown = [point for point in points if point[0] == point[0] and point[1] == point[1]]
    axis = {"type": "value", "scale": True, "nameLocation": "middle", "axisLabel": {"color": GREY}}
    axis |= {"nameTextStyle": {"color": GREY}, "splitLine": {"lineStyle": {"color": GREY, "opacity": 0.3}}}
    return {
        "animation": False,
        "grid": {"left": 70, "right": 24, "top": 24, "bottom": 56},
        "tooltip": {"trigger": "item"},
        "dataZoom": [{"type": "inside", "xAxisIndex": 0}, {"type": "inside", "yAxisIndex": 0}],
        "xAxis": {**axis, "name": x, "nameGap": 32},
        "yAxis": {**axis, "name": y, "nameGap": 52},
        "series": [{"type": "scatter", "symbolSize": 5, "data": shown}],
    }
