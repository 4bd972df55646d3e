"""The histogram of a frame, with black, white and gamma."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from nicegui import ui

from tsis.console import widgets
from tsis.console.live.charts import chart, line, redraw
from tsis.console.live.hub import FULL

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from tsis.console.services.frames import FrameAnalysis
    from tsis.model.image import TactileImage

    Apply = Callable[[tuple[float, float], float], object]


DARKEST, BRIGHTEST = 0.01, 0.999  # share of the pixels below the lower end, and below the upper end
LEAST = 24.0  # levels between the two ends, so that noise alone does not become a picture
BINS = 256
GAMMA = (0.2, 3.0)  # of the slider
CURVE = np.linspace(0.0, 1.0, 21)


def autoscale(counts: Sequence[int]) -> tuple[float, float]:
    """The ends, in levels of 255, between which nearly all pixels of a histogram lie.

    Examples
    --------
    >>> autoscale([0, 500, 500, 0])
    (65.0, 192.0)
    """
    upto = np.concatenate([[0.0], np.cumsum(counts, dtype=float)])  # inside a bin they are taken as evenly spread
    ends = np.interp(np.array([DARKEST, BRIGHTEST]) * upto[-1], upto, np.linspace(0.0, FULL, len(upto)))
    low, high = float(np.floor(ends[0])), float(np.ceil(ends[1]))
    start = min(low, FULL - LEAST)
    return (low, high) if high - low >= LEAST else (start, start + LEAST)


class DisplayRange:
    """Histogram of the grey levels over two handles, black and white, and gamma; ``apply`` gets the ends and gamma."""

    def __init__(self, apply: Apply) -> None:
        self._apply = apply
        self._counts: tuple[int, ...] = ()
        self._full_scale = FULL
        self.ends, self.gamma = (0.0, FULL), 1.0
        with ui.element("figure").classes("histogram"):
            plain = {"type": "value", "show": False, "min": 0}
            self._chart = chart(
                "grey levels",
                {
                    "grid": {"left": 12, "right": 12, "top": 6, "bottom": 22},
                    "xAxis": {"type": "value", "min": 0, "max": FULL},
                    "yAxis": [plain, {**plain, "max": 1}],
                    "series": [],
                },
                style="histogram-chart",
            )
            with ui.element("div").classes("histogram-range"):
                self._range = ui.range(
                    min=0, max=255, step=1, value={"min": 0, "max": 255}, on_change=lambda: self._moved()
                ).props('dense label aria-label="Black and white, grey levels of 255"')
            self._range.on("change", lambda: self._say(), args=[])  # not while it is dragged, which sends it back
            self._say()
            with ui.element("div").classes("row tools"):
                widgets.button("Auto", self.automatic, look="outline dense")
                self._follow = ui.switch("keep", value=False, on_change=lambda: self._following())
                self._follow.tooltip("Autoscale every frame")
                widgets.button("Reset", self.reset, look="outline dense")
                ui.label("Gamma").classes("muted")
                low, high = GAMMA
                self._gamma = ui.slider(min=low, max=high, step=0.05, value=1.0, on_change=lambda: self._moved())
                self._gamma.props('dense aria-label="Gamma"').classes("gamma")
                self._log = ui.switch("log", value=True, on_change=lambda: self._draw())
                self._log.tooltip("Logarithm of the number of pixels")
            self._text = widgets.muted()
            self._warnings = widgets.Redrawn(ui.element("div").props("role=status"))

    def automatic(self) -> None:
        """Choose the ends by the frame that is shown."""
        if self._counts:
            self._choose(autoscale(self._counts), self.gamma)

    def reset(self) -> None:
        """Show black as black, full scale as white, and what lies between evenly."""
        self._follow.value = False
        self._choose((0.0, FULL), 1.0)

    def show_image(self, image: TactileImage, *, zero: float = 0.0) -> None:
        """Show the levels of a single frame; ``zero`` as of `tsis.console.live.view.StillView`."""
        self._full_scale = image.full_scale
        top = image.full_scale * (1 + 1 / BINS)
        counts = np.histogram(np.clip(image.grey - zero, 0, image.full_scale), BINS, (0.0, top))[0]
        self._show(tuple(counts.tolist()), float((image.grey >= image.full_scale).mean()), ())

    def show(self, analysis: FrameAnalysis | None, full_scale: float) -> None:
        """Show the newest frame; None without one."""
        self._full_scale = full_scale or self._full_scale
        if analysis is None:
            self._show((), None, ())
        elif analysis.histogram != self._counts:
            self._show(analysis.histogram, analysis.clipped_share, analysis.warnings)

    def _show(self, counts: tuple[int, ...], clipped: float | None, warnings: tuple[str, ...]) -> None:
        self._counts = counts
        if self._follow.value:
            self.automatic()
        self._clipped = "no frame" if clipped is None else f"{clipped:.2%} of the pixels at full scale"
        if self._warnings.changes_to(warnings):
            with self._warnings.element:
                for warning in warnings:
                    ui.label(f"Exposure: {warning}").classes("doubtful")
        self._draw()

    def _following(self) -> None:
        if self._follow.value:
            self.automatic()

    def _choose(self, ends: tuple[float, float], gamma: float) -> None:
        self._gamma.value = gamma
        self._range.value = {"min": ends[0], "max": ends[1]}  # calls `_moved`
        self._moved()
        self._say()

    def _say(self) -> None:
        """Say the ends to readers of the screen: the pages' library gives them two numbers in one."""
        low, high = self._range.value["min"], self._range.value["max"]
        self._range.props["aria-valuenow"] = low
        self._range.props["aria-valuetext"] = f"black {low:.0f}, white {high:.0f}"

    def _moved(self) -> None:
        low, high = float(self._range.value["min"]), float(self._range.value["max"])
        ends = (low, max(high, low + 1)) if low < FULL else (FULL - 1, FULL)
        gamma = float(self._gamma.value)
        if (ends, gamma) != (self.ends, self.gamma):
            self.ends, self.gamma = ends, gamma
            self._apply(ends, gamma)
            self._draw()

    def _draw(self) -> None:
        unit = self._full_scale / FULL
        (low, high), counts = self.ends, np.array(self._counts or (0,), dtype=float)
        heights = np.log10(1 + counts) if self._log.value else counts
        levels = (np.arange(len(heights)) + 0.5) / len(heights) * self._full_scale
        share = CURVE**self.gamma
        curve = np.column_stack([(low + CURVE * (high - low)) * unit, share])
        marks = [{"xAxis": low * unit}, {"xAxis": high * unit}]
        redraw(
            self._chart,
            xAxis={**self._chart.options["xAxis"], "max": self._full_scale},
            series=[
                line(
                    "logarithm of pixels" if self._log.value else "pixels",
                    np.column_stack([levels, heights]).round(3).tolist(),
                    step="middle",
                    lineStyle={"width": 0},
                    areaStyle={"color": "var(--accent)", "opacity": 0.8},
                    markLine={
                        "symbol": "none",
                        "silent": True,
                        "label": {"show": False},
                        "lineStyle": {"color": "var(--ink)", "type": "dashed"},
                        "data": marks,
                    },
                ),
                line(
                    "brightness", curve.round(3).tolist(), yAxisIndex=1, lineStyle={"color": "var(--warn)", "width": 1}
                ),
            ],
        )
        ends = f"black {low * unit:.0f}, white {high * unit:.0f}, gamma {self.gamma:.2f}"
        self._text.text = f"{ends} · {self._clipped}" if self._counts else ends
        self._chart.props["aria-label"] = f"grey levels: {self.text(counts)}; {ends}"

    @staticmethod
    def text(counts: np.ndarray) -> str:
        """A histogram as text, for screen readers."""
        if not counts.sum():
            return "no frame"
        half = int(np.searchsorted(np.cumsum(counts), counts.sum() / 2)) + 1
        return f"half of the pixels below {half / len(counts):.0%} of full scale"
