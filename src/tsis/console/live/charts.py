"""Charts by ECharts in the console's colours."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nicegui import ui

if TYPE_CHECKING:
    from collections.abc import Sequence

    from nicegui.elements.echart import EChart

_AXIS = {
    "axisLine": {"show": True, "lineStyle": {"color": "var(--muted)"}},
    "axisTick": {"show": True, "lineStyle": {"color": "var(--muted)"}},
    "axisLabel": {"color": "var(--muted)", "hideOverlap": True},
    "nameTextStyle": {"color": "var(--muted)"},
    "splitLine": {"show": False},
    "nameLocation": "middle",
}
THEME = {
    "color": ["var(--accent)", "var(--warn)", "var(--good)"],
    "backgroundColor": "transparent",
    "textStyle": {"color": "var(--ink)"},
    "valueAxis": _AXIS,
    "logAxis": _AXIS,
    "legend": {"textStyle": {"color": "var(--ink)"}},
    "axisPointer": {"lineStyle": {"color": "var(--muted)"}},
    "tooltip": {
        "backgroundColor": "var(--panel)",
        "borderColor": "var(--line)",
        "textStyle": {"color": "var(--ink)", "fontSize": 12},
    },
}


def chart(label: str, options: dict[str, Any], *, style: str) -> EChart:
    """Place a chart; ``label`` is what readers of the screen say, ``style`` the class that gives its height."""
    common = {"animation": False, "tooltip": {"trigger": "axis", "confine": True}}
    made = ui.echart({**common, **options}, renderer="svg", theme=THEME).classes(style)
    made.props["role"], made.props["aria-label"] = "img", label
    return made


def line(name: str, places: Sequence[Sequence[float | None]], **more: Any) -> dict[str, Any]:
    """A line through places (x, y), without marks on them."""
    drawn = {"type": "line", "name": name, "data": places, "showSymbol": False, "lineStyle": {"width": 1.5}}
    return {**drawn, "emphasis": {"disabled": True}, **more}


def redraw(made: EChart, **options: Any) -> None:
    """Replace some options of a chart, which stays as it is where nothing changes."""
    if any(made.options.get(name) != value for name, value in options.items()):
        made.options.update(options)
        made.update()
