"""What is measured on a shown frame."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from nicegui import run, ui

from tsis.console import widgets
from tsis.console.live.charts import chart, line, redraw
from tsis.errors import TsisError
from tsis.imaging.regions import SHAPES, LineProfile, distance, line_profile, region_statistics

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.console.live.view import FrameView, Point
    from tsis.model.image import TactileImage


PROFILE, DISTANCE = "profile", "distance"
TOOLS = {PROFILE: "Profile", DISTANCE: "Distance", SHAPES[0]: "Rectangle", SHAPES[1]: "Ellipse"}
HINT = "Drag across the frame, or move the two points by hand or with the arrow keys."


class Measurement(NamedTuple):
    """The facts of a measurement, and its profile if it is one."""

    facts: tuple[tuple[str, str], ...]
    profile: LineProfile | None = None


def measurement(image: TactileImage, tool: str, start: Point, end: Point) -> Measurement:
    """Measure a frame with a tool of `TOOLS` between two points (x, y) in pixels; errors as of the functions."""
    length, unit = distance(image, start, end)
    facts = [("distance", f"{length:.2f} {unit}")]
    if tool == DISTANCE:
        return Measurement(tuple(facts))
    if tool == PROFILE:
        profile = line_profile(image, start, end)
        low, high = float(profile.grey.min()), float(profile.grey.max())
        return Measurement((*facts, ("grey level", f"{low:.1f} to {high:.1f}")), profile)
    found = region_statistics(image, tool, start, end)
    return Measurement(
        (
            ("mean ± sd", f"{found.mean:.1f} ± {found.sd:.1f} grey levels"),
            ("median", f"{found.median:.1f}"),
            ("range", f"{found.minimum:.0f} to {found.maximum:.0f}"),
            ("pixels", f"{found.count:,}" + (f", {found.clipped_count:,} clipped" if found.clipped_count else "")),
            ("area", f"{found.area:.4g} {found.unit}²" if found.unit == "mm" else "scale unknown"),
        )
    )


class MeasuringTools:
    """The choice of what is measured on a view, and the result; ``frame`` gives the frame, in a thread."""

    def __init__(self, view: FrameView, frame: Callable[[], TactileImage | None]) -> None:
        self._view, self._frame = view, frame
        self._shape: tuple[str, Point, Point] | None = None
        self._busy = False
        with ui.element("div").classes("row tools").props('role=group aria-label="Measure"'):
            self.tool = ui.toggle(TOOLS, clearable=True, on_change=lambda: self._choose())
            self.tool.props("dense unelevated toggle-color=primary no-caps").classes("roles")
        self._hint = widgets.muted(HINT)
        self._facts = widgets.FactList()
        self._chart = chart(
            "grey level along the line",
            {
                "grid": {"left": 52, "right": 12, "top": 10, "bottom": 40},
                "xAxis": {
                    "type": "value",
                    "name": "distance / px",
                    "nameGap": 24,
                    "min": 0,
                    "max": "dataMax",
                    "axisLabel": {"showMaxLabel": False},  # which is no round number
                },
                "yAxis": {"type": "value", "name": "grey level", "nameGap": 36, "scale": True},
                "series": [],
            },
            style="profile-chart",
        )
        view.on_shape(self._moved)
        self._choose()

    async def refresh(self) -> None:
        """Measure again, on the newest frame."""
        if self._shape is None or self._busy:
            return
        self._busy = True
        shape = self._shape
        try:
            result = await run.io_bound(self._measure, shape)
        finally:
            self._busy = False
        if result is not None and self._shape is not None:
            self._show(result)
        if shape != self._shape:
            await self.refresh()

    def _measure(self, shape: tuple[str, Point, Point]) -> Measurement | None:
        image = self._frame()
        try:
            return None if image is None else measurement(image, *shape)
        except TsisError as error:
            return Measurement((("not measured", str(error)),))

    async def _moved(self, tool: str, start: Point, end: Point) -> None:
        if tool == self.tool.value:  # else the last message of a tool that was left
            self._shape = (tool, start, end)
            await self.refresh()

    def _choose(self) -> None:
        self._shape = None
        self._view.measure(self.tool.value or "")
        self._hint.set_visibility(bool(self.tool.value))
        self._facts.show(())
        self._chart.set_visibility(False)

    def _show(self, result: Measurement) -> None:
        self._facts.show(result.facts)
        profile = result.profile
        self._chart.set_visibility(profile is not None)
        if profile is not None:
            places = [
                [round(float(x), 4), round(float(y), 2)] for x, y in zip(profile.distance, profile.grey, strict=True)
            ]
            axis = {**self._chart.options["xAxis"], "name": f"distance / {profile.unit}"}
            redraw(self._chart, xAxis=axis, series=[line("grey level", places)])
            self._chart.props["aria-label"] = f"grey level along the line: {dict(result.facts)['grey level']}"
