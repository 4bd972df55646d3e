"""Figures of matched point sets, and of trials of matching methods."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike, NDArray

    from tsis.matching import Alternative
    from tsis.matching.trials import TrialSummary


SOURCE, TARGET, PAIR = "#0072b2", "#d55e00", "0.65"  # distinct without red-green vision
CURVE_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#000000", "#56b4e9", "#e69f00")
CURVE_MARKS = "ovs^Dp*Xhd<>"
NAMES = {"failures": "share of failures", "seconds": "median time / s"}
FEW, LARGE, SMALL = 300, 18.0, 4.0  # points up to which the dots are large
MOST_DRAWN = 5000  # points of each set
GRID, GRID_LINES, GRID_SAMPLES, GRID_MARGIN = "0.8", 16, 60, 0.05


def point_sets(
    source: ArrayLike,
    target: ArrayLike,
    ax: Axes,
    *,
    matches: ArrayLike | None = None,
    source_label: str = "source",
    target_label: str = "target",
) -> Axes:
    """Draw two point sets over each other, with a line from each source point to its match.

    Shapes are (n, 2) and (m, 2), or (n, 3) and (m, 3) on an axes with the projection ``"3d"``. ``matches``, shape (n,),
    has the row of each source point's match or -1. Of more than `MOST_DRAWN` points every second, third, ... is drawn.
    """
    first, second = np.asarray(source, dtype=float), np.asarray(target, dtype=float)
    rows, others = (np.arange(0, len(item), -(-len(item) // MOST_DRAWN)) for item in (first, second))
    surface: Any = ax  # three-dimensional axes, which the declared class does not cover
    size = LARGE if max(len(first), len(second)) <= FEW else SMALL
    if matches is not None:
        partner = np.asarray(matches)
        paired = rows[partner[rows] >= 0]
        ends = np.full((len(paired), 3, first.shape[1]), np.nan)  # a NaN ends a line
        ends[:, 0], ends[:, 1] = first[paired], second[partner[paired]]
        surface.plot(*ends.reshape(-1, first.shape[1]).T, color=PAIR, linewidth=0.7, zorder=1)
    hollow = {"facecolors": "none", "edgecolors": SOURCE}
    surface.scatter(
        *first[rows].T, s=2 * size, label=f"{source_label} ({len(first)})", linewidths=1.0, zorder=3, **hollow
    )
    surface.scatter(*second[others].T, s=size / 2, label=f"{target_label} ({len(second)})", color=TARGET, zorder=2)
    ax.set_aspect("equal")
    ax.set(xlabel="x", ylabel="y")
    if first.shape[1] == 3:
        surface.set_zlabel("z")
    ax.legend(loc="best", fontsize="small")
    return ax


def warped_grid(transform: Callable[[NDArray[np.float64]], NDArray[np.float64]], source: ArrayLike, ax: Axes) -> Axes:
    """Draw the image of a square grid about the source's points, shape (n, 2), under a transform of points (k, 2)."""
    points = np.asarray(source, dtype=float)
    low, high = points.min(axis=0), points.max(axis=0)
    margin = GRID_MARGIN * (high - low).max()
    low, high = low - margin, high + margin
    step = (high - low).max() / GRID_LINES
    for axis in range(2):
        along = np.linspace(low[axis], high[axis], GRID_SAMPLES)
        for at in np.arange(low[1 - axis], high[1 - axis] + step / 2, step):
            line = np.empty((GRID_SAMPLES, 2))
            line[:, axis], line[:, 1 - axis] = along, at
            ax.plot(*transform(line).T, color=GRID, linewidth=0.6, zorder=0)
    return ax


def alternative_pose(alternative: Alternative, target: ArrayLike, ax: Axes) -> Axes:
    """Draw the source in one of the poses that the data allow over the target, with its rotation and probability."""
    point_sets(alternative.moved, target, ax)
    if (legend := ax.get_legend()) is not None:
        legend.remove()  # it would hide points of a small panel
    ax.set_title(f"rotation {alternative.rotation_deg:.0f}°, probability {alternative.probability:.3g}")
    return ax


def curves_over_levels(
    summaries: Sequence[TrialSummary],
    ax: Axes,
    *,
    quantity: Literal["error", "failures", "seconds"],
    positions: Mapping[str, float],
    level_label: str,
    unit: str = "",
) -> Axes:
    """Draw the error of each method over the levels of a distortion (figures 5.14 to 5.18 and 5.20).

    Parameters
    ----------
    summaries
        Of one group, the result of `tsis.matching.trials.summarise`.
    quantity
        ``"error"`` draws the median as a line and the mean as a separate mark, ``"failures"`` and ``"seconds"`` a
        line.
    positions
        Where each level lies on the axis.
    level_label
        Name and unit of the axis.
    unit
        Of the error, where it has one.
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


TRIAL_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")  # distinct without red-green vision
LEVEL_STYLES = ("-", "--", ":", "-.")


def trial_errors(
    errors: Mapping[str, ArrayLike],
    ax: Axes,
    *,
    levels: Mapping[str, float],
    error_label: str,
    top: float | None = None,
) -> Axes:
    """Draw the error of each trial, a colour for each method, with horizontal lines at published errors.

    ``errors`` has shape (trials,) by method, ``levels`` the values of the lines by name. Errors beyond ``top`` are
    drawn there as triangles; by default the axis shows all.
    """
    for colour, (name, values) in zip(itertools.cycle(TRIAL_COLOURS), errors.items(), strict=False):
        shown = np.asarray(values, dtype=float)
        trial = np.arange(1, len(shown) + 1)
        beyond = np.zeros(shown.shape, dtype=bool) if top is None else shown > top
        ax.plot(trial[~beyond], shown[~beyond], ".", color=colour, markersize=4, label=name)
        if beyond.any():
            ax.plot(trial[beyond], np.full(beyond.sum(), top), "^", color=colour, markersize=5, clip_on=False)
    for style, (name, level) in zip(itertools.cycle(LEVEL_STYLES), levels.items(), strict=False):
        ax.axhline(level, color="0.25", linestyle=style, linewidth=1.2, label=name)
    ax.set(xlabel="trial", ylabel=error_label)
    ax.set_ylim(bottom=0.0, top=top)
    return ax
