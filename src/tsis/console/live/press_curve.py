"""Force and radius of the contact over the last seconds."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.console.live.charts import chart, line, redraw

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.console.services.frames import PressMoment


SHOWN_S = 30.0


def curves(
    moments: Sequence[PressMoment], mm_per_pixel: tuple[float, float] | None
) -> tuple[list[list[float | None]], list[list[float | None]], str]:
    """Places (seconds before the newest moment, value) of force and radius, and the radius's unit.

    The force is in newtons. A moment without a contact or with an unknown force breaks the line.
    """
    scale, unit = (mm_per_pixel, "mm") if mm_per_pixel else ((1.0, 1.0), "px")
    newest = moments[-1].time_s if moments else 0.0
    forces: list[list[float | None]] = []
    radii: list[list[float | None]] = []
    for moment in moments:
        before = round(moment.time_s - newest, 2)
        if before < -SHOWN_S:
            continue
        forces.append([before, None if moment.force_n is None else round(moment.force_n, 3)])
        radii.append([before, None if moment.contact is None else round(moment.contact.radius(scale), 3)])
    return forces, radii, unit


class PressCurve:
    """The two curves, one above the other, over the same seconds."""

    def __init__(self) -> None:
        both = {"type": "value", "scale": True, "nameGap": 36, "splitNumber": 2, "min": 0}
        time = {"type": "value", "min": -SHOWN_S, "max": 0}
        hidden = {**time, "gridIndex": 0, "axisLabel": {"show": False}}
        self._chart = chart(
            "force and radius of the contact over the last 30 seconds",
            {
                "grid": [
                    {"left": 52, "right": 12, "top": 10, "height": 60},
                    {"left": 52, "right": 12, "top": 84, "height": 60},
                ],
                "axisPointer": {"link": [{"xAxisIndex": "all"}]},
                "xAxis": [hidden, {**time, "gridIndex": 1, "name": "time / s", "nameGap": 24}],
                "yAxis": [
                    {**both, "gridIndex": 0, "name": "force / N"},
                    {**both, "gridIndex": 1, "name": "radius / mm"},
                ],
                "series": [],
            },
            style="press-chart",
        )

    def show(self, moments: Sequence[PressMoment], mm_per_pixel: tuple[float, float] | None) -> None:
        """Show the last seconds; the newest moment stands at the right."""
        forces, radii, unit = curves(moments, mm_per_pixel)
        first, second = self._chart.options["yAxis"]
        redraw(
            self._chart,
            yAxis=[first, {**second, "name": f"radius / {unit}"}],
            series=[
                line("force / N", forces),
                line(f"radius / {unit}", radii, xAxisIndex=1, yAxisIndex=1, color="var(--warn)"),
            ],
        )
        if forces:
            now = (
                f"{value:.2f} {of}" for (_, value), of in ((forces[-1], "N"), (radii[-1], unit)) if value is not None
            )
            label = "force and radius of the contact over the last 30 seconds, now "
            self._chart.props["aria-label"] = label + (" and ".join(now) or "none")
