"""Errors of matching methods over the levels of a distortion, drawn."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from benchmarks.matching.summary import TrialSummary
    from matplotlib.axes import Axes

CURVE_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#000000", "#56b4e9", "#e69f00")
CURVE_MARKS = "ovs^Dp*Xhd<>"
NAMES = {"failures": "share of failures", "seconds": "median time / s"}


def curves_over_levels(
    summaries: Sequence[TrialSummary],
    ax: Axes,
    *,
    quantity: Literal["error", "failures", "seconds"],
    positions: Mapping[str, float],
    level_label: str,
    unit: str = "",
) -> Axes:
    """Draw the error of each method over the levels of a distortion (figures 5.14, 5.15, 5.16, 5.17, 5.18 and 5.20).

    The ``summaries`` are those of one group, ``positions`` where each level lies on the axis. ``"error"`` draws the
    median as a line and the mean as a separate mark, ``"failures"`` and ``"seconds"`` a line; ``unit`` is that of the
    error, where it has one.
    """
    styles = zip(itertools.cycle(CURVE_COLOURS), itertools.cycle(CURVE_MARKS), strict=False)
    methods = dict.fromkeys(summary.method for summary in summaries)
    for order, (method, (colour, mark)) in enumerate(zip(methods, styles, strict=False)):
        own = [summary for summary in summaries if summary.method == method]
        position = [positions[item.level] for item in own]
        line = "-" if order < len(CURVE_COLOURS) else "--"
        middle = [item.median if quantity == "error" else getattr(item, quantity) for item in own]
        ax.plot(position, middle, line, color=colour, marker=mark, markersize=4, linewidth=1.2, label=method)
        if quantity == "error":
            ax.plot(position, [item.mean for item in own], mark, color=colour, markerfacecolor="none", markersize=8)
    ending = f" / {unit}" if unit and quantity == "error" else ""
    label = "RMS error: median (line), mean (open mark)" if quantity == "error" else NAMES[quantity]
    ax.set(xlabel=level_label, ylabel=label + ending)
    if quantity == "failures":
        ax.set_ylim(-0.02, 1.02)
    else:
        ax.set_yscale("log")
    ax.grid(visible=True, alpha=0.3)
    return ax
